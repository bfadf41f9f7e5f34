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
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any

import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.node import Node
from std_srvs.srv import SetBool

from smartmesh_ros.startup.dds import isolated

ROOT = Path(__file__).resolve().parents[1]
START = "from smartmesh_ros.startup.executables import terrain_collider; terrain_collider()"
TIMEOUT = 600.0  # [s]


@dataclass
class Start:
    """A node's start: times of its first log line and its first answer [s], and its peak memory [MiB]."""

    line: float
    answer: float
    memory: float


def environment(cache: Path, package: Path | None) -> dict[str, str]:
    """Return this environment with an empty user cache, and with ``package`` in front of the installed package."""
    kept = {**os.environ}
    path = [str(package), kept.get("PYTHONPATH", "")] if package else [kept.get("PYTHONPATH", "")]
    return {**kept, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": os.pathsep.join(path), "PYTHONUNBUFFERED": "1"}


def started(count: int, package: Path | None) -> list[Start]:
    """Start ``count`` nodes together and wait until each has answered a call. Raises `TimeoutError`."""
    node = Node("start_study")
    prefix = Path(get_package_prefix("smartmesh_ros")) / "lib" / "smartmesh_ros" / "terrain_collider"
    command = [sys.executable, "-P", "-c", START] if package else [str(prefix)]
    lines: dict[int, float] = {}
    answers: dict[int, Start] = {}
    with tempfile.TemporaryDirectory() as cache:
        names = [f"/n{index}" for index in range(count)]
        clients = [node.create_client(SetBool, f"{name}/terrain_collider/pause") for name in names]
        begin = monotonic()
        running = [
            subprocess.Popen(
                [*command, "--ros-args", "-r", f"__ns:={name}"],
                env=environment(Path(cache), package), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
            )
            for name in names
        ]  # fmt: skip

        def read(index: int) -> None:
            for _ in running[index].stderr or ():
                lines.setdefault(index, monotonic() - begin)

        try:
            for index in range(count):
                Thread(target=read, args=[index], daemon=True).start()
            calls: list[tuple[int, Any]] = []
            asked: dict[int, float] = {}  # when [s]
            while len(answers) < count and monotonic() < begin + TIMEOUT:
                rclpy.spin_once(node, timeout_sec=0.02)
                for index, client in enumerate(clients):
                    # DDS may lose the answer to a call of the first moments, so it is repeated.
                    if index not in answers and client.service_is_ready() and monotonic() > asked.get(index, 0.0) + 0.2:
                        asked[index] = monotonic()
                        calls.append((index, client.call_async(SetBool.Request(data=False))))
                for index, call in calls:
                    if index not in answers and call.done():
                        status = Path(f"/proc/{running[index].pid}/status").read_text()
                        memory = int(status.split("VmHWM:")[1].split()[0]) / 1024
                        answers[index] = Start(lines.get(index, float("nan")), monotonic() - begin, memory)
        finally:
            for process in running:
                process.terminate()
                process.wait()
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


def last_answer(starts: list[Start]) -> float:
    """Return the time until the last answer [s]."""
    return max(start.answer for start in starts)


def report(name: str, starts: list[Start]) -> float:
    """Print a row of the table; return the time until the last answer [s]."""
    line, answer = max(start.line for start in starts), last_answer(starts)
    print(f"| {name} | {line:.2f} s | {answer:.2f} s | {max(start.memory for start in starts):.0f} MiB |", flush=True)
    return answer


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
            runs = sorted((started(count, package) for _ in range(options.runs)), key=last_answer)
            medians.append(report(case, runs[len(runs) // 2]))
        rclpy.shutdown()
    print(f"\nfour nodes took {medians[2] / medians[0]:.2f} times as long as one")


if __name__ == "__main__":
    main()
