"""A child process that makes robots, so that a crash of PyBullet's loader does not end this process."""

from __future__ import annotations

import os
import pickle
import select
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from threading import Lock
from time import monotonic
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.shapes import BodyShape

if TYPE_CHECKING:
    from smartmesh_ros.world.robots.prepared import PreparedRobot

# Longest time for one robot [s]. The largest meshes of real robots take a few seconds; a loader that hangs must end.
PATIENCE = 120.0
# The child ends after this time without work [s], which frees its memory of some 100 MB.
IDLE = 60.0
_START = "import sys; sys.path[:] = {path!r}; from smartmesh_ros.world.robots.worker import main; main()"
_LENGTH = 8  # bytes of the length before each message


class Refusal(NamedTuple):
    """An `InputError` of the child."""

    reason: str
    message: str


Made = tuple[Mapping[str, bytes], Mapping[int, BodyShape]]


class Workshop:
    """Starts the child when there is work, and again if it ended."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._lock = Lock()

    def make(self, robot: PreparedRobot) -> Made:
        """Return the mesh files of a robot and the shapes of its links, after loading it in the child. Raises
        `InputError` if the robot is refused, or PyBullet crashes or hangs."""
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
        if isinstance(answer, Refusal):
            raise InputError(answer.reason, answer.message)
        made: Made = answer
        return made

    def close(self) -> None:
        """End the child, also while it works."""
        child = self._child
        if child is not None:
            child.kill()
            child.wait()

    def _ask(self, robot: PreparedRobot) -> Any:
        """Return the child's answer, None if it ended without one."""
        if self._child is None or self._child.poll() is not None:
            self._child = _started()
        child = self._child
        assert child.stdin is not None and child.stdout is not None
        try:
            send(child.stdin, robot)
        except OSError:
            return None
        return _received(child.stdout, PATIENCE)

    def _ended(self) -> int:
        """End the child and return its exit code, zero if it had ended by itself."""
        child = self._child
        assert child is not None
        try:
            code = child.wait(1.0)
        except subprocess.TimeoutExpired:
            child.kill()
            code = child.wait()
        for pipe in (child.stdin, child.stdout):
            assert pipe is not None
            with suppress(OSError):  # what the child did not read
                pipe.close()
        return code


def _started() -> subprocess.Popen[bytes]:
    # A session of its own: Ctrl-C ends this process, and then the child, whose input ends.
    return subprocess.Popen(
        [sys.executable, "-c", _START.format(path=sys.path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


def send(pipe: IO[bytes], value: Any) -> None:
    """Write a value to a pipe."""
    data = pickle.dumps(value)
    pipe.write(len(data).to_bytes(_LENGTH, "little") + data)
    pipe.flush()


def _received(pipe: IO[bytes], patience: float) -> Any:
    """Return the value that another process writes to a pipe within ``patience`` [s]; None if there is none."""
    ends, data, length = monotonic() + patience, b"", _LENGTH
    while len(data) < length:
        if not select.select([pipe], [], [], max(ends - monotonic(), 0.0))[0]:
            return None
        part = os.read(pipe.fileno(), 1 << 20)
        if not part:
            return None
        data += part
        if len(data) >= _LENGTH:
            length = _LENGTH + int.from_bytes(data[:_LENGTH], "little")
    return pickle.loads(data[_LENGTH:])


WORKSHOP = Workshop()
