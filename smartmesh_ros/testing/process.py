"""Nodes as processes of a test, none of which outlives it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix

# How long conditions may take [s]: far longer than on an idle machine.
PATIENCE = 30.0
# How long a collider may take to be ready [s]: one that finds no machine code compiles, for minutes on a busy machine.
STARTING = 300.0
# Asks Linux for SIGKILL (9) when the parent ends (option 1 of prctl), unless that is past, and becomes the command.
_ASK = """
import ctypes, os, sys
ctypes.CDLL(None).prctl(1, 9)
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""


def executable(name: str, package: str = "smartmesh_ros") -> Path:
    """Path of an installed executable, looked up in the ament index as ``ros2 run`` does."""
    path = Path(get_package_prefix(package)) / "lib" / package / name
    if not path.is_file():
        raise FileNotFoundError(f"package {package} has no executable {name}; build and source the workspace")
    return path


class Process:
    """A node in a process of its own, its output kept; a context manager that ends it.

    It ends with the block, at the latest with the Python process that started it, on Linux even if that is killed.
    """

    def __init__(
        self,
        name: str,
        parameters: dict[str, Any] | None = None,
        arguments: Sequence[str] = (),
        *,
        package: str = "smartmesh_ros",
        environment: dict[str, str] | None = None,
    ) -> None:
        self.name = name
        command = [str(executable(name, package)), *arguments]
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        if parameters:
            file = folder / "parameters.yaml"
            file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
            command += ["--ros-args", "--params-file", str(file)]
        environment = {**os.environ, **(environment or {})}
        self._log = folder / "log.txt"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                _ending_with_this(command), stdout=log, stderr=subprocess.STDOUT, env=environment
            )
        self._close = weakref.finalize(self, _end, self.process, self._folder)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            if not self._closed:
                self.stop()
        finally:
            self.close()

    @property
    def output(self) -> str:
        """What it has printed so far."""
        return self._log.read_text(errors="replace")

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal, waits for the end and returns the exit code.

        It is sent again after a while: one that arrives while a node is still starting may be lost.
        """
        for _ in range(2):
            if self.process.poll() is None:
                self.process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                return self.process.wait(PATIENCE / 3)
        return self.process.wait(PATIENCE / 3)

    def close(self) -> None:
        """End it whatever it takes."""
        self._close()

    @property
    def _closed(self) -> bool:
        return not self._close.alive


def assert_cannot_start(
    parameters: dict[str, Any], words: str, *, name: str = "terrain_collider", environment: dict[str, str] | None = None
) -> None:
    """Assert that a node of this package ends at once with exit code 2 and says why, in ``words``."""
    process = Process(name, parameters, environment=environment)
    try:
        assert process.process.wait(PATIENCE) == 2, process.output
        assert words in process.output, process.output
        assert "Traceback" not in process.output, process.output
    finally:
        process.close()


def _end(process: subprocess.Popen[bytes], folder: tempfile.TemporaryDirectory[str]) -> None:
    """Kill a process that still runs, and removes its folder."""
    if process.poll() is None:
        process.kill()
        process.wait()
    folder.cleanup()


def _ending_with_this(command: list[str]) -> list[str]:
    """Return the command, asked to end when this process does: by a Python that then becomes the command."""
    return [sys.executable, "-I", "-S", "-c", _ASK, str(os.getpid()), *command] if sys.platform == "linux" else command
