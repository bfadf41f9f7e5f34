"""Runs one case: terrain, the node that serves patches, and MuJoCo, each as a process of its own."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import psutil
import yaml

from studies.consumer.cases import Case
from studies.consumer.drive import PATIENCE, Drive
from studies.load.processes import environment

# How long starting, and judging after the drive, may take beside it [s].
BESIDE = PATIENCE + 60.0


def run_case(case: Case) -> Drive:
    """Drives a case. Raises `RuntimeError` with the processes' last words if it fails."""
    case = replace(case, start=time.time())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "case.json").write_text(json.dumps(asdict(case)))
        (folder / "parameters.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": case.parameters()}}))
        run = [sys.executable, "-m"]
        terrain = [*run, "studies.consumer.publish", str(folder / "case.json")]
        mujoco = [*run, "studies.consumer.drive", str(folder / "case.json"), str(folder / "result.json")]
        commands = [terrain, _node(folder / "parameters.yaml")] if case.source == "patches" else [terrain]
        with _running([*commands, mujoco], folder / "log.txt") as processes:
            used = _wait(processes[-1], processes[1].pid if case.source == "patches" else None, case.seconds + BESIDE)
            failed = processes[-1].poll() != 0
        if failed:
            raise RuntimeError(f"{case.name} failed: {(folder / 'log.txt').read_text(errors='replace')[-3000:]}")
        return Drive(**{**json.loads((folder / "result.json").read_text()), "node": used})


def _node(parameters: Path) -> list[str]:
    from ament_index_python.packages import get_package_prefix

    node = Path(get_package_prefix("smartmesh_ros")) / "lib" / "smartmesh_ros" / "terrain_collider"
    return [str(node), "--ros-args", "--params-file", str(parameters)]


def _wait(driver: subprocess.Popen[bytes], node: int | None, limit: float) -> float:
    """Waits for the driver's end, at most ``limit`` [s]; how many processors the node used, the median of its life."""
    end, samples = time.monotonic() + limit, []
    while driver.poll() is None and time.monotonic() < end:
        if node is not None and psutil.pid_exists(node):
            samples.append((time.monotonic(), sum(psutil.Process(node).cpu_times()[:2])))
        with suppress(subprocess.TimeoutExpired):
            driver.wait(0.5)
    steps = np.diff(np.array(samples).reshape(-1, 2), axis=0)
    return float(np.median(steps[:, 1] / steps[:, 0])) if len(steps) else math.nan


@contextmanager
def _running(commands: list[list[str]], log: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """The commands as processes for the length of the block; what they print goes to one file."""
    processes: list[subprocess.Popen[bytes]] = []
    with log.open("wb") as out:
        try:
            for command in commands:
                processes.append(subprocess.Popen(command, stdout=out, stderr=out, env=environment()))  # noqa: PERF401
            yield processes
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                try:
                    process.wait(10.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
