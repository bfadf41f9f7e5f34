"""``smartmesh-compile``: compile all functions in advance, on all cores, and print the folder of the machine code.

`make`, `colcon build` and building the wheel do the same. A node compiles at its first start if none of these did.
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

# Periods of polling the processes and of printing progress [s].
POLL_PERIOD, PROGRESS_PERIOD = 0.05, 10.0
# Option of prctl, from <linux/prctl.h>: the signal that a process receives when its parent ends.
PR_SET_PDEATHSIG = 1
# Serialized message without bodies, input of the functions that parse body states of other nodes.
NO_BODIES = struct.pack("<4s2iI4x5fI", b"\0\1\0\0", 0, 0, 1, 0.0, 60.0, 0.0, 0.0, -9.81, 0)


class _Recorder:
    """Replaces a compiled function: runs it as Python and records the argument types of each call.

    Only calls from Python are recorded, because Numba infers the types of calls between compiled functions.
    """

    depth = 0
    calls: dict[tuple[Any, Any], None] = {}  # noqa: RUF012  # of all functions, in order of the first call

    def __init__(self, made: Any) -> None:
        self.made = made
        self._signature = signature(made.py_func)
        self.__name__, self.__doc__ = made.py_func.__name__, made.py_func.__doc__

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if not _Recorder.depth:
            _Recorder.calls[self.made, self._types_of(arguments, named)] = None
        _Recorder.depth += 1
        try:
            return self.made.py_func(*arguments, **named)
        finally:
            _Recorder.depth -= 1

    def _types_of(self, arguments: Any, named: Any) -> tuple[Any, ...]:
        given = self._signature.bind(*arguments, **named).arguments
        return tuple(
            self.made.typeof_pyval(given[name]) if name in given else compiled.omitted(parameter.default)
            for name, parameter in self._signature.parameters.items()
        )


def fill() -> None:
    """Compile all functions into a folder; the main function of a dedicated process, which exits with 1 on failure.

    All functions first run as Python on small maps, to record their argument types. Then this process forks workers,
    which take the functions from a common queue.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that waits for this one handles Ctrl-C
    folder, digest, parent, *progress = sys.argv[1:]
    _end_with_parent(int(parent))
    if digest != machine_code.DIGEST:
        sys.exit("the sources changed meanwhile")
    place = Path(folder)
    os.environ[machine_code.FOLDER_VARIABLE] = str(place.parent)
    machine_code.remove_old(place.parent)
    calls = _record()
    functions: set[Any] = set()
    for function, _ in calls:
        _called_by(function, functions)
    with _tasks(len(calls)) as tasks:
        gc.freeze()
        children = [_child(tasks, calls) for _ in range(machine_code.processes())]
        try:
            _wait(children, place, int(parent), len(functions) if progress else 0)
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
    """Return the function and argument types of every call of a warm-up, largest functions first."""
    compiled.stand_in = _Recorder
    from smartmesh_ros.startup.quiet import silence_pybullet  # imported late, so that the recorder is in place

    silence_pybullet()
    from smartmesh_ros.node.fleet.peer_states import PeerReader
    from smartmesh_ros.warm_up import run_through

    run_through()
    PeerReader().read(NO_BODIES, 0, 0)
    for module in [module for name, module in sys.modules.items() if name.startswith("smartmesh_ros.")]:
        _restore(module)
    for function, _ in _Recorder.calls:
        function.add_wrapper()
    return sorted(_Recorder.calls, key=lambda call: -len(_called_by(call[0], set())))


def _restore(module: ModuleType) -> None:
    """Replace the recorders in a module by the compiled functions."""
    for name, value in list(vars(module).items()):
        if isinstance(value, _Recorder):
            setattr(module, name, value.made)


def _called_by(function: Any, found: set[Any]) -> set[Any]:
    """Return ``found`` plus a compiled function and all compiled functions it calls, directly or indirectly."""
    found.add(function)
    code = function.py_func.__code__
    for name in code.co_names:
        called = function.py_func.__globals__.get(name)
        if hasattr(called, "py_func") and called not in found:
            _called_by(called, found)
    return found


@contextmanager
def _tasks(count: int) -> Iterator[int]:
    """Yield the reading end of a pipe that holds task numbers, one byte each; a byte reaches one reader only."""
    reading, writing = os.pipe()
    os.write(writing, bytes(range(count)))
    os.close(writing)
    try:
        yield reading
    finally:
        os.close(reading)


def _child(tasks: int, calls: list[tuple[Any, Any]]) -> int:
    """Fork a worker that compiles until no tasks are left; return its process id."""
    parent = os.getpid()
    if child := os.fork():
        return child
    code = 1
    try:
        _end_with_parent(parent)
        compiled.shared_folder = True
        while number := os.read(tasks, 1):
            function, types = calls[number[0]]
            function.compile(types)
        code = 0
    finally:
        sys.stderr.flush()
        os._exit(code)


def _end_with_parent(parent: int) -> None:
    """Make Linux kill this process when its ``parent`` ends, and exit if it has ended. Elsewhere, `_wait` checks."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


def _wait(children: list[int], place: Path, parent: int, total: int) -> None:
    """Wait for all children; exit if one fails, or if the ``parent`` of this process has ended.

    Prints the progress and the time left, unless the ``total`` number of functions is 0.
    """
    start = reported = monotonic()
    failed = 0
    while children:
        for child in list(children):
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                children.remove(child)
                failed += bool(status)
        if failed or os.getppid() != parent:
            sys.exit(f"{failed} compiling processes failed" if failed else 1)
        if total and monotonic() > reported + PROGRESS_PERIOD:
            reported = monotonic()
            done = len({path.name.partition("-")[0] for path in place.glob(f"*.{compiled.GENERIC}")})
            spent = reported - start
            left = f", about {spent * (total - done) / done:.0f} s left" if done else ""
            print(f"compiled {done} of {total} functions in {spent:.0f} s{left}", flush=True)
        sleep(POLL_PERIOD)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    argparse.ArgumentParser(
        prog="smartmesh-compile", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args(arguments)
    start = monotonic()
    try:
        place = machine_code.compile_all(progress=True)
    except machine_code.NotCompiledError as reason:
        sys.exit(f"nothing was compiled in advance: {reason}")
    print(f"machine code is ready in {place} after {monotonic() - start:.1f} s")


if __name__ == "__main__":
    main()
