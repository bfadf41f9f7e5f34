"""Runs one case: the node and the driver as processes of their own, watched from outside."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import psutil

from smartmesh_ros.tools.testing.process import Process
from studies.load.cases import Case


class Watch:
    """Processor time and memory of a process and its children."""

    def __init__(self, pid: int) -> None:
        self._process = psutil.Process(pid)

    def processes(self) -> list[psutil.Process]:
        """The process and its children."""
        return [self._process, *self._process.children(recursive=True)]

    def cpu(self) -> float:
        """Processor time so far [s]."""
        return sum(sum(process.cpu_times()[:2]) for process in self.processes())

    def memory(self) -> dict[str, float]:
        """Resident memory, its part that is shared memory of DDS, and its highest value so far [MiB]."""
        totals = dict.fromkeys(("VmRSS", "RssShmem", "VmHWM"), 0.0)
        for process in self.processes():
            for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
                key, _, value = line.partition(":")
                if key in totals:
                    totals[key] += float(value.split()[0]) / 1024.0
        return {"resident": totals["VmRSS"], "shared": totals["RssShmem"], "peak": totals["VmHWM"]}

    def descriptors(self) -> int:
        """Open file descriptors."""
        return sum(process.num_fds() for process in self.processes())


def run_case(case: Case) -> dict[str, Any]:
    """Runs a case and returns what the driver saw and what the processes took. Raises `RuntimeError` if it fails."""
    with (
        tempfile.TemporaryDirectory() as name,
        Process("terrain_collider", case.parameters()) as node,
    ):
        given, found = Path(name) / "case.json", Path(name) / "result.json"
        given.write_text(json.dumps(asdict(case)))
        command = [sys.executable, "-m", "studies.load.driver", str(given), str(found)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
            try:
                usage = _watch(node.process, driver)
                if driver.wait(10) or node.process.poll() is not None:
                    raise RuntimeError(f"{case.name} failed: {node.output[-2000:]}")
            finally:
                driver.kill()
        return {"case": asdict(case), **json.loads(found.read_text()), **usage}


def _watch(node: subprocess.Popen[bytes], driver: subprocess.Popen[str]) -> dict[str, Any]:
    """Usage of both from the time the driver says it has started until it ends: CPUs used, and memory [MiB]."""
    assert driver.stdout is not None
    driver.stdout.readline()
    watches = {"node": Watch(node.pid), "driver": Watch(driver.pid)}
    samples: list[tuple[float, dict[str, float]]] = []
    memory: dict[str, dict[str, float]] = {}
    while driver.poll() is None and node.poll() is None:
        try:
            samples.append((monotonic(), {name: watch.cpu() for name, watch in watches.items()}))
            memory = {name: watch.memory() for name, watch in watches.items()}
        except (psutil.NoSuchProcess, FileNotFoundError):
            break
        sleep(0.25)
    (start, first), (end, last) = samples[0], samples[-1]
    span = max(end - start, 1e-9)
    return {"cpus": {name: (last[name] - first[name]) / span for name in first}, "memory_mib": memory}
