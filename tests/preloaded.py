"""Starts nodes as forks of one process that has imported what they import.

A node spends most of what a short test takes on imports. A fork runs the same entry point as the executable, in a
process and an environment of its own. Tests of the start, and of other environments, use the executables; see the
fixture ``executables``.
"""

import multiprocessing
import os
import signal
import subprocess
import sys
from contextlib import suppress
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from threading import Thread
from typing import IO

import psutil

from smartmesh_ros.startup import executables
from smartmesh_ros.startup.executables import STDERR, STDOUT
from smartmesh_ros.tools.testing.process import start_command

# Executables by name, whose modules `tests.preloaded_modules` imports.
ENTRY_POINTS = ("fleet_front", "terrain_collider", "terrain_score", "terrain_sensor", "terrain_source")
# Variables that are read after the imports: with the context, and with the participant of DDS.
READ_LATE = {"FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOG_DIR"}

_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(["tests.preloaded_modules"])


class Fork:
    """A fork, with the methods of `subprocess.Popen` that tests use."""

    def __init__(self, process: ForkServerProcess) -> None:
        assert process.pid is not None
        self._process, self.pid = process, process.pid

    @property
    def returncode(self) -> int | None:
        """The exit code, None while it runs; -N: ended by signal N."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code at the end. Raises `subprocess.TimeoutExpired`."""
        self._process.join(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return self.returncode

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it has ended."""
        if self.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, sig)

    def kill(self) -> None:
        """Send SIGKILL, unless it has ended."""
        self.send_signal(signal.SIGKILL)


def start(command: list[str], log: IO[bytes], environment: dict[str, str]) -> Fork | subprocess.Popen[bytes]:
    """Start a command: as a fork if it is an executable of this package, and its environment differs from this
    process's in no variable but `READ_LATE`."""
    name = Path(command[0]).name
    changed = {variable for variable, _ in environment.items() ^ os.environ.items()}
    if name not in ENTRY_POINTS or not changed <= READ_LATE:
        return start_command(command, log, environment)
    process = _context.Process(target=_run, args=(name, command, log.name, environment), name=name, daemon=True)
    process.start()
    return Fork(process)


def _run(name: str, command: list[str], log: str, environment: dict[str, str]) -> None:
    """Run an entry point in the forked process."""
    Thread(target=_end_with_tests, daemon=True).start()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with Path(log).open("ab", buffering=0) as output:
        for number in (STDOUT, STDERR):
            os.dup2(output.fileno(), number)
    sys.stdout = os.fdopen(STDOUT, "w", buffering=1, closefd=False)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = command
    getattr(executables, name)()


def _end_with_tests() -> None:
    """End this process when the one that asked for it ends, however that happens."""
    tests = multiprocessing.parent_process()
    assert tests is not None
    tests.join()
    os._exit(1)


def has_ended(process: int) -> bool:
    """Whether a process, by its id, has ended; its parent may not have asked for its exit code yet."""
    try:
        return bool(psutil.Process(process).status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True
