"""Measures the start of nodes: time from the command to the first line and to an answered service, and peak memory.

    make start-study                  # about two minutes on an idle machine with two cores
    make start-study ARGS="--runs 5"

Each case starts with an empty user cache. The cases: the colcon workspace of ``make``; a wheel, installed by pip into a
separate folder; and four nodes of the workspace that start together.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import rclpy
from rclpy.node import Node
from std_srvs.srv import SetBool

from smartmesh_ros.startup.dds import isolated
from smartmesh_ros.tools.testing import Process

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT = 600.0  # [s]


class Start(NamedTuple):
    """A node's start: times of its first log line and its first answer [s], and its peak memory [MiB]."""

    line: float
    answer: float
    memory: float


def started(count: int, package: Path | None) -> list[Start]:
    """Start ``count`` nodes together, with an empty user cache and with a ``package`` in front of the installed one,
    and wait until each has answered a call. Raises `TimeoutError`."""
    node, names = Node("start_study"), [f"/n{index}" for index in range(count)]
    clients = [node.create_client(SetBool, f"{name}/terrain_collider/pause") for name in names]
    lines: dict[int, float] = {}
    answers: dict[int, Start] = {}
    with ExitStack() as stack:
        path = os.pathsep.join(filter(None, [str(package or ""), os.environ.get("PYTHONPATH", "")]))
        settings = {"XDG_CACHE_HOME": stack.enter_context(tempfile.TemporaryDirectory()), "PYTHONPATH": path}
        begin = monotonic()
        running = [
            stack.enter_context(
                Process("terrain_collider", None, ["--ros-args", "-r", f"__ns:={name}"], environment=settings)
            )
            for name in names
        ]
        calls: list[tuple[int, Any]] = []
        asked: dict[int, float] = {}  # when [s]
        while len(answers) < count and monotonic() < begin + TIMEOUT:
            rclpy.spin_once(node, timeout_sec=0.02)
            for index, client in enumerate(clients):
                if index not in lines and running[index].output:
                    lines[index] = monotonic() - begin
                # DDS may lose the answer to a call of the first moments, so it is repeated.
                if index not in answers and client.service_is_ready() and monotonic() > asked.get(index, 0.0) + 0.2:
                    asked[index] = monotonic()
                    calls.append((index, client.call_async(SetBool.Request(data=False))))
            for index, call in calls:
                if index not in answers and call.done():
                    status = Path(f"/proc/{running[index].process.pid}/status").read_text()
                    memory = int(status.split("VmHWM:")[1].split()[0]) / 1024
                    answers[index] = Start(lines.get(index, float("nan")), monotonic() - begin, memory)
    node.destroy_node()
    if len(answers) < count:
        raise TimeoutError(f"{count - len(answers)} nodes did not answer")
    return list(answers.values())


def wheel(folder: Path) -> Path:
    """Build a wheel from these sources, install it by pip into ``folder``; return the folder of the package."""
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    begin = monotonic()
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", folder, ROOT], check=True, stdout=subprocess.DEVNULL
    )
    [made] = folder.glob("*.whl")
    print(f"| {made.name}, {made.stat().st_size / 2**20:.1f} MiB, built in | | {monotonic() - begin:.1f} s | |")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "target", made], check=True)
    return folder / "target"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3, help="starts of each case")
    options = parser.parse_args()
    print(f"load before: {os.getloadavg()[0]:.1f}\n")
    print("| start | first line | answered | memory |\n|---|---|---|---|")
    with isolated(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rclpy.init()
        medians = []
        for case, count, package in (
            ("make, colcon build", 1, None),
            ("pip install of the wheel", 1, wheel(folder / "wheel")),
            ("make, four nodes together", 4, None),
        ):
            runs = [Start(*map(max, zip(*started(count, package), strict=True))) for _ in range(options.runs)]
            median = sorted(runs, key=lambda run: run.answer)[len(runs) // 2]
            medians.append(median.answer)
            print(f"| {case} | {median.line:.2f} s | {median.answer:.2f} s | {median.memory:.0f} MiB |", flush=True)
        rclpy.shutdown()
    print(f"\nfour nodes took {medians[2] / medians[0]:.2f} times as long as one")


if __name__ == "__main__":
    main()
