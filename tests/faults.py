"""The k-th call of some kind fails, for k = 1, 2, ... until a run makes fewer calls."""

import builtins
import inspect
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import InputError

# Ends a run that never makes fewer calls than fail.
MOST_RUNS = 2000
# Calls that tests make to look at a client, and that end it.
QUIET = ("getNumBodies", "isConnected", "disconnect")


class Faults:
    """Counts calls while a block of `failing` runs, and lets one of them fail. ``fired``: the call that failed, or
    empty. ``errors``: those that users are to see; ``said``: by that of the last operation that was not `done`."""

    def __init__(self, *errors: type[Exception]) -> None:
        self.fired = self.said = ""
        self._errors = errors
        self._left: int | None = None  # calls until the one that fails

    @contextmanager
    def failing(self, number: int) -> Iterator[None]:
        """Let the ``number``-th call of the block fail."""
        self.fired, self._left = "", number
        try:
            yield
        finally:
            self._left = None

    def done(self, number: int, operation: Callable[[], object]) -> bool:
        """Whether an operation is done whose ``number``-th call fails; if not, its error was one of ``errors``."""
        try:
            with self.failing(number):
                operation()
        except self._errors as error:
            self.said = str(error)
            return False
        return True

    def runs(self) -> Iterator[int]:
        """Yield 1, 2, ... until nothing failed in a block."""
        for number in range(1, MOST_RUNS):
            yield number
            if not self.fired:
                return
        raise AssertionError(f"still failing after {MOST_RUNS} runs: {self.fired}")

    def counted(self, name: str, function: Callable[..., Any], error: Callable[[str], Exception]) -> Any:
        """Return a function that counts as a call."""

        def call(*args: Any, **kwargs: Any) -> Any:
            if self._left is not None:
                self._left -= 1
                if self._left == 0:
                    self.fired = name
                    raise error(f"{name} fails as the test wants")
            return function(*args, **kwargs)

        return call


def bullet_faults(monkeypatch: pytest.MonkeyPatch) -> Faults:
    """Faults of PyBullet's functions, called through a client or not."""
    faults = Faults(pb.error, InputError)
    names = {name for name, found in vars(pb).items() if inspect.isbuiltin(found) and name not in QUIET}
    for name in names:
        monkeypatch.setattr(pb, name, faults.counted(name, getattr(pb, name), pb.error))
    original = BulletClient.__getattr__

    def attribute(client: Any, name: str) -> Any:
        return partial(getattr(pb, name), physicsClientId=client._client) if name in names else original(client, name)

    monkeypatch.setattr(BulletClient, "__getattr__", attribute)
    return faults


def file_faults(monkeypatch: pytest.MonkeyPatch) -> Faults:
    """Faults of opening a file, and of reading it or writing to it."""
    faults, opened = Faults(InputError), io.open

    def open_file(*args: Any, **kwargs: Any) -> Any:
        file = opened(*args, **kwargs)
        return FaultyFile(file, faults)

    for module in (builtins, io):
        monkeypatch.setattr(module, "open", faults.counted("open", open_file, OSError))
    return faults


class FaultyFile:
    """A file whose calls count. A write that fails leaves half of the data."""

    def __init__(self, file: Any, faults: Faults) -> None:
        self._file, self._faults = file, faults

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._file, name)
        return self._faults.counted(name, found, OSError) if name.startswith("read") else found

    def write(self, data: Any) -> Any:
        self._file.write(data[: len(data) // 2])
        return self._faults.counted("write", self._file.write, OSError)(data[len(data) // 2 :])

    def __iter__(self) -> Any:
        return iter(self._file)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
