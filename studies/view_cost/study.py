"""``python -m studies view-cost``: the node with the view open and closed, by turns in one run.

Bodies on a map of which a region moves; a process takes what a page would get, so that no browser takes part in what is
measured.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import monotonic
from typing import Any

import psutil
import rclpy
import yaml
from ament_index_python.packages import get_package_prefix

from smartmesh_ros.startup.domains import isolated
from studies.load.cases import Case
from studies.load.driver import Driver
from studies.load.processes import Watch, environment, node_command
from studies.tables import table

_REGIONS = Case(side=1024, bodies=100, mode="regions", map_rate=60.0, physics_rate=240.0, markers=False)
CASES = {
    "regions": _REGIONS,
    "large": replace(_REGIONS, side=4096),
    "whole": replace(_REGIONS, side=4096, mode="full", map_rate=1.0),
}
# The outputs that a page listens to; --rate has the node publish them so often.
OUTPUTS = ("collider_patches", "body_states", "contacts")
# Each turn settles before it is measured [s].
SETTLE = 3.0


class Measuring:
    """A node, somebody who sends it terrain, and the view of it, in this DDS domain. A context manager."""

    def __init__(self, case: Case, rate: float | None) -> None:
        self._folder = tempfile.TemporaryDirectory()
        rates = {} if rate is None else {f"publish.{topic}": rate for topic in OUTPUTS}
        parameters = Path(self._folder.name) / "parameters.yaml"
        parameters.write_text(yaml.safe_dump({"/**": {"ros__parameters": {**case.parameters(), **rates}}}))
        variables = environment()
        quiet: dict[str, Any] = {"stderr": subprocess.DEVNULL, "env": variables}
        self._node = subprocess.Popen(node_command(case, parameters), stdout=subprocess.DEVNULL, **quiet)
        view = Path(get_package_prefix("smartmesh_ros")) / "lib" / "smartmesh_ros" / "view"
        self._view = subprocess.Popen([str(view), "--port", "0"], stdout=subprocess.PIPE, text=True, **quiet)
        self._driver = Driver(case)
        self._watches = {"node": Watch(self._node.pid), "view": Watch(self._view.pid)}
        self._port = 0

    def __enter__(self) -> Measuring:
        self._driver.start()
        assert self._view.stdout is not None
        while not self._port:
            found = re.search(r"shown at http://localhost:(\d+)", self._view.stdout.readline())
            self._port = int(found[1]) if found else 0
        self._driver.wait_for(lambda: self._driver.listeners() == 2, "view")
        self._driver.send(whole=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._driver.destroy_node()
        for process in (self._view, self._node):
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
        self._folder.cleanup()

    def turn(self, seconds: float, *, opened: bool) -> dict[str, float]:
        """One turn: times of the node's steps [us], processor time of both [s/s], and what the page got a second."""
        import viser

        command = [sys.executable, "-m", "studies.view_cost.listener", f"ws://localhost:{self._port}"]
        command += [f"viser-v{viser.__version__}", str(seconds + 1.0)]
        page = subprocess.Popen(command, stdout=subprocess.PIPE, text=True) if opened else None
        self._driver.run(SETTLE)
        self._driver.windows.clear()
        start, before = monotonic(), {name: watch.cpu() for name, watch in self._watches.items()}
        self._driver.run(seconds)
        length = monotonic() - start
        found = {f"{name}_cpu": (watch.cpu() - before[name]) / length for name, watch in self._watches.items()}
        windows = self._driver.windows
        for stage in ("total", "publish", "ingest"):
            found[stage] = median(window["stages"][stage][1] for window in windows)
        found["total_p99"] = median(window["stages"]["total"][2] for window in windows)
        found["real_time_factor"] = median(window["real_time_factor"] for window in windows)
        if page is not None:
            found |= json.loads(page.communicate(timeout=30.0)[0])
        return found


def measure(case: Case, turns: int, seconds: float, rate: float | None) -> dict[str, dict[str, float]]:
    """Medians over the turns, with the view closed and open."""
    found: dict[str, list[dict[str, float]]] = {"closed": [], "open": []}
    with isolated():
        rclpy.init()
        try:
            with Measuring(case, rate) as measuring:
                for number in range(turns):
                    order = ("closed", "open") if number % 2 else ("open", "closed")
                    for name in order:
                        found[name].append(measuring.turn(seconds, opened=name == "open"))
                        print(f"  turn {number + 1} of {turns}, {name}: {found[name][-1]}", flush=True)
        finally:
            rclpy.shutdown()
    return {name: {key: median(of[key] for of in turn) for key in turn[0]} for name, turn in found.items()}


def report(found: dict[str, dict[str, float]]) -> str:
    """The medians as a Markdown table."""
    rows = [
        ("step of the node, median [us]", "total", 0), ("step, 99 % [us]", "total_p99", 0),
        ("publishing, median [us]", "publish", 0), ("real-time factor", "real_time_factor", 3),
        ("processor of the node [cores]", "node_cpu", 3), ("processor of the view [cores]", "view_cpu", 3),
        ("moves of bodies that the page gets [Hz]", "moves_hz", 1), ("longest time without one [s]", "longest_s", 2),
        ("changes of the ground [Hz]", "ground_hz", 1),
        ("data to the page [MB/s]", "mb_s", 1),
    ]  # fmt: skip
    return table(
        ["", "closed", "open"],
        [
            [words, *(f"{found[side][key]:.{digits}f}" if key in found[side] else "-" for side in ("closed", "open"))]
            for words, key, digits in rows
        ],
    )


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--case", choices=CASES, default="regions", help="1024^2 or 4096^2 with regions, or whole 4096^2"
    )
    parser.add_argument("--turns", type=int, default=6, help="of each kind (%(default)s)")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each turn (%(default)s)")
    parser.add_argument("--rate", type=float, help="at which the node publishes what a page shows [Hz]; else its own")
    options = parser.parse_args()
    case = replace(CASES[options.case], seconds=options.seconds)
    print(f"{case.bodies} bodies, {case.side}^2, {case.mode} at {case.map_rate:g} Hz; {psutil.cpu_count()} cores")
    print(report(measure(case, options.turns, options.seconds, options.rate)))


if __name__ == "__main__":
    main()
