"""Nodes as child processes of a test, which end with the test at the latest."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import IO, Any, ClassVar

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.executables import executable

# Default limit of waits [s], far longer than an idle machine needs.
TIMEOUT = 120.0
# Limit of a collider's start [s], for busy machines.
START_TIMEOUT = 300.0
# Time after which a signal that had no effect is sent again [s].
PATIENCE = 5.0
# Lets the command receive SIGINT, even if this process ignores it, as a shell's background jobs do. Requests SIGKILL
# (9) from Linux when the parent ends (PR_SET_PDEATHSIG = 1), then executes the command unless the parent has ended.
_EXIT_WITH_PARENT = """
import ctypes, os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, 9)
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""


def start_command(command: list[str], log: IO[bytes], environment: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start a command as a child that ends with this process at the latest, on Linux even if that is killed.

    For Linux the parent is the thread that starts the child, so that thread waits for the child's end.
    """
    starter = [sys.executable, "-I", "-S", "-c", _EXIT_WITH_PARENT, str(os.getpid())]
    started: Future[subprocess.Popen[bytes]] = Future()

    def run() -> None:
        try:
            child = subprocess.Popen([*starter, *command], stdout=log, stderr=subprocess.STDOUT, env=environment)
        except BaseException as error:  # noqa: BLE001  # raised where the result is awaited
            started.set_exception(error)
        else:
            started.set_result(child)
            child.wait()

    Thread(target=run, daemon=True).start()
    return started.result()


class Process:
    """A node in a child process whose output is recorded. A context manager.

    The process ends with the block, at the latest with the Python process that started it, on Linux even if that is
    killed.
    """

    # Starts a command with its output in a file, in an environment. A suite with many nodes may set another.
    starter: ClassVar[Callable[[list[str], IO[bytes], dict[str, str]], subprocess.Popen[bytes]]] = staticmethod(
        start_command
    )

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
        text = _parameter_file(parameters or {})
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        if parameters:
            file = folder / "parameters.yaml"
            file.write_text(text)
            command += ["--ros-args", "--params-file", str(file)]
        environment = {**os.environ, **(environment or {})}
        self._log = folder / "log.txt"
        with self._log.open("wb") as log:
            self.process = Process.starter(command, log, environment)
        self._close = weakref.finalize(self, _end, self.process, self._folder)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.stop()
        finally:
            self.close()

    @property
    def output(self) -> str:
        """The output of the process so far, also after its end."""
        return self._log.read_text(errors="replace") if self._close.alive else self._output

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal, wait for the end and return the exit code.

        The signal is sent again every `PATIENCE`, because a process that has just started ignores SIGINT if this one
        does, as a shell's background jobs do.
        """
        for _ in range(round(TIMEOUT / PATIENCE)):
            if self.process.poll() is None:
                self.process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                return self.process.wait(PATIENCE)
        raise subprocess.TimeoutExpired(self.name, TIMEOUT)

    def close(self) -> None:
        """Kill the process if it still runs, and remove its files."""
        self._output = self.output
        self._close()


def assert_cannot_start(
    parameters: dict[str, Any], words: str, *, name: str = "terrain_collider", environment: dict[str, str] | None = None
) -> None:
    """Assert that a node of this package exits with code 2 and that its output contains ``words``, no traceback."""
    with Process(name, parameters, environment=environment) as process:
        assert process.process.wait(TIMEOUT) == 2, process.output
        assert words in process.output, process.output
        assert "Traceback" not in process.output, process.output


def _parameter_file(parameters: dict[str, Any]) -> str:
    """Return the text of a parameter file. Raises `InputError` if YAML has no such value."""
    for name, value in parameters.items():
        try:
            yaml.safe_dump(value)
        except yaml.YAMLError:
            wanted = "a number, a text, true, false, or a list of one of these, of the types of Python itself"
            raise InputError("parameter", f"{name} is {value!r}; it must be {wanted}") from None
    return str(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))


def _end(process: subprocess.Popen[bytes], folder: tempfile.TemporaryDirectory[str]) -> None:
    """Kill the process if it still runs, and remove its folder."""
    if process.poll() is None:
        process.kill()
        process.wait()
    folder.cleanup()
