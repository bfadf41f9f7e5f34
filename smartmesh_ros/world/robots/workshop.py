"""A child process that makes robots, so that a crash of PyBullet's loader does not end this process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Lock
from typing import Any

from smartmesh_ros.errors import InputError

# Longest time for one robot [s]. The largest meshes of real robots take a few seconds; a loader that hangs must end.
PATIENCE = 120.0
# The child ends after this time without work [s], which frees its memory of some 100 MB.
IDLE = 60.0
_START = "import sys; sys.path[:] = {path!r}; from smartmesh_ros.world.robots.worker import main; main({pipe})"


@cache
def robots_folder() -> tempfile.TemporaryDirectory[str]:
    """Return the folder of this process's robots, which is removed at its end. The child's files are in it, because one
    that is killed or crashes removes none."""
    return tempfile.TemporaryDirectory(prefix="smartmesh_robots_")


class Workshop:
    """Starts the child when there is work, and again if it ended."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._lock = Lock()

    def make(self, robot: object) -> Mapping[str, bytes]:
        """Return the mesh files of a `PreparedRobot`, after loading it in the child. Raises `InputError` if the robot
        is refused, or PyBullet crashes or hangs."""
        with self._lock:
            answer = self._ask(robot)
            if answer is None and self._ended() == 0:  # the child was idle too long as the robot came
                answer = self._ask(robot)
            if answer is None:
                code = self._ended()
                raise InputError(
                    "urdf", f"PyBullet crashes or hangs when it loads the robot (exit code {code} of a trial in "
                    "another process); check the description with check_urdf, and its meshes"
                )  # fmt: skip
        if isinstance(answer, InputError):
            raise answer
        files: Mapping[str, bytes] = answer
        return files

    def close(self) -> None:
        """End the child, also while it works."""
        child = self._child
        if child is not None:
            child.kill()
            child.wait()

    def _ask(self, robot: object) -> Any:
        """Return the child's answer, None if it ended without one, or is late."""
        if self._pipe is None or self._child is None or self._child.poll() is not None:
            self._start()
        assert self._pipe is not None
        try:
            self._pipe.send(robot)
            return self._pipe.recv() if self._pipe.poll(PATIENCE) else None
        except (OSError, EOFError):
            return None

    def _start(self) -> None:
        self._pipe, childs = Pipe()
        with childs:
            # A session of its own: Ctrl-C ends this process, and then the child, whose pipe ends.
            self._child = subprocess.Popen(
                [sys.executable, "-c", _START.format(path=sys.path, pipe=childs.fileno())], pass_fds=[childs.fileno()],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
                env={**os.environ, "TMPDIR": robots_folder().name},
            )  # fmt: skip

    def _ended(self) -> int:
        """End the child and return its exit code, zero if it had ended by itself."""
        child, pipe = self._child, self._pipe
        assert child is not None and pipe is not None
        try:
            code = child.wait(1.0)
        except subprocess.TimeoutExpired:
            child.kill()
            code = child.wait()
        pipe.close()
        return code


WORKSHOP = Workshop()
