"""``smartmesh-compile``: has all functions compiled beforehand, on all cores, and says where the machine code is kept.

Nodes do the same at their first start if nobody did it before; `make`, `colcon build` and the wheel do it too.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import os
import signal
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from time import monotonic, sleep
from types import ModuleType
from typing import Any

from smartmesh_ros import compiled, machine_code

# How often the processes are looked at, and how often progress is told [s].
LOOK, TELL = 0.05, 2.0
# The option of prctl, from <linux/prctl.h>, that names the signal a process gets when its parent ends.
PR_SET_PDEATHSIG = 1
# A message without bodies, for the functions that read body states of other nodes.
NOBODY = struct.pack("<4s2iI4x5fI", b"\0\1\0\0", 0, 0, 1, 0.0, 60.0, 0.0, 0.0, -9.81, 0)


class _Recorded:
    """Stands for a compiled function: runs as Python and notes the types of the arguments it is called with.

    Only calls from Python are noted; Numba finds the types of calls between compiled functions by itself.
    """

    depth = 0
    calls: dict[tuple[Any, Any], None] = {}  # noqa: RUF012  # of all functions together, in order
    ran: set[Any] = set()  # noqa: RUF012

    def __init__(self, made: Any) -> None:
        self.made = made
        self._signature = signature(made.py_func)
        self.__name__, self.__doc__ = made.py_func.__name__, made.py_func.__doc__

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        _Recorded.ran.add(self.made)
        if not _Recorded.depth:
            _Recorded.calls[self.made, self._types_of(arguments, named)] = None
        _Recorded.depth += 1
        try:
            return self.made.py_func(*arguments, **named)
        finally:
            _Recorded.depth -= 1

    def _types_of(self, arguments: Any, named: Any) -> tuple[Any, ...]:
        given = self._signature.bind(*arguments, **named).arguments
        return tuple(
            self.made.typeof_pyval(given[name]) if name in given else compiled.omitted(parameter.default)
            for name, parameter in self._signature.parameters.items()
        )


def fill() -> None:
    """Compiles everything into a folder, in a process of its own that was started for it; exits with 1 if it cannot.

    All compiled functions run as Python first, on small maps, which tells the types of their arguments. Then this
    process forks several, each of which takes the next function that nobody has taken.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits for this one
    parent = os.getppid()
    folder, digest, *progress = sys.argv[1:]
    if digest != machine_code.DIGEST:
        sys.exit("the sources changed meanwhile")
    place = Path(folder)
    os.environ[machine_code.CHOSEN] = str(place.parent)
    machine_code.remove_old(place.parent)
    calls = _record()
    with _tasks(len(calls)) as tasks:
        gc.freeze()
        children = [_child(tasks, calls) for _ in range(machine_code.processes())]
        try:
            _wait(children, place, parent, bool(progress))
        except BaseException:
            for child in children:
                os.kill(child, signal.SIGKILL)
            raise
    for lock in place.glob("*.lock"):
        lock.unlink(missing_ok=True)
    if machine_code.sources_changed():
        sys.exit("the sources changed meanwhile")
    (place / machine_code.COMPLETE).write_text("")


def _record() -> list[tuple[Any, Any]]:
    """Functions and types of arguments of all calls that a warm-up makes, those of the largest functions first."""
    compiled.instead = _Recorded
    from smartmesh_ros.startup.quiet import silence_pybullet  # those below are imported only now

    silence_pybullet()
    from smartmesh_ros.node.fleet.peer_states import PeerReader
    from smartmesh_ros.warm_up import run_through

    run_through()
    PeerReader().read(NOBODY, 0, 0)
    for module in [module for name, module in sys.modules.items() if name.startswith("smartmesh_ros.")]:
        _put_back(module)
    return sorted(_Recorded.calls, key=lambda call: -len(_called_by(call[0], set())))


def _put_back(module: ModuleType) -> None:
    """Puts the compiled functions back into a module."""
    for name, value in list(vars(module).items()):
        if isinstance(value, _Recorded):
            setattr(module, name, value.made)


def _called_by(function: Any, found: set[Any]) -> set[Any]:
    """All compiled functions that one calls, itself among them."""
    found.add(function)
    code = function.py_func.__code__
    for name in code.co_names:
        called = function.py_func.__globals__.get(name)
        if hasattr(called, "py_func") and called not in found:
            _called_by(called, found)
    return found


@contextmanager
def _tasks(count: int) -> Iterator[int]:
    """A pipe that holds the numbers of tasks, a byte each: who reads one has it alone."""
    reading, writing = os.pipe()
    os.write(writing, bytes(range(count)))
    os.close(writing)
    try:
        yield reading
    finally:
        os.close(reading)


def _child(tasks: int, calls: list[tuple[Any, Any]]) -> int:
    """A process that compiles until there are no tasks left; its id."""
    if child := os.fork():
        return child
    code = 1
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)  # it ends with the process that started it
        compiled.shared = True
        while number := os.read(tasks, 1):
            function, types = calls[number[0]]
            function.compile(types)
        code = 0
    finally:
        sys.stderr.flush()
        os._exit(code)


def _wait(children: list[int], place: Path, parent: int, progress: bool) -> None:
    """Waits for all children; ends if one fails, or if nobody waits for this process any more."""
    start = told = monotonic()
    failed = 0
    while children:
        for child in list(children):
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                children.remove(child)
                failed += bool(status)
        if failed or os.getppid() != parent:
            sys.exit(f"{failed} processes that compile failed" if failed else 1)
        if progress and monotonic() > told + TELL:
            told = monotonic()
            names = {path.name.partition("-")[0] for path in place.glob(f"*.{compiled.GENERIC}")}
            print(f"compiled {len(names)} of some {len(_Recorded.ran)} functions in {told - start:.0f} s", flush=True)
        sleep(LOOK)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line."""
    argparse.ArgumentParser(
        prog="smartmesh-compile", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args(arguments)
    start = monotonic()
    place = machine_code.prepare(progress=True)
    if place is None:
        sys.exit("nothing was compiled beforehand")
    print(f"machine code is ready in {place}, after {monotonic() - start:.1f} s")


if __name__ == "__main__":
    main()
