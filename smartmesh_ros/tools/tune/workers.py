"""Processes of one search, which share a storage."""

from __future__ import annotations

import multiprocessing
import pickle
import signal
from time import monotonic, sleep
from typing import TYPE_CHECKING

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.quiet import silence_pybullet

if TYPE_CHECKING:
    from smartmesh_ros.tools.tune.session import Request

# Time that processes have to mark their trials as failed and end [s]. Then they are killed.
STOP_TIMEOUT = 20.0


class Workers:
    """``jobs`` processes of one search. A context manager that ends the processes in any case; results stay stored."""

    def __init__(self, request: Request, jobs: int) -> None:
        context = multiprocessing.get_context("spawn")
        # Pickled here, because unpickling imports PyBullet, which prints its build time unless it is silenced first.
        packed = pickle.dumps(request)
        self._processes = [context.Process(target=_work, args=(packed, index), daemon=True) for index in range(jobs)]

    def __enter__(self) -> Workers:
        for process in self._processes:
            process.start()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            if process.is_alive() and process.pid:
                process.terminate()
        end = monotonic() + STOP_TIMEOUT
        for process in self._processes:
            process.join(max(end - monotonic(), 0.1))
            if process.is_alive():
                process.kill()

    def wait(self, seconds: float) -> bool:
        """Wait, then return True if a process is still running. Raise `InputError` if one has failed."""
        sleep(seconds)
        failed = [process.exitcode for process in self._processes if process.exitcode]
        if failed:
            raise InputError("jobs", f"a process of the search ended with code {failed[0]}; see its output above")
        return any(process.is_alive() for process in self._processes)


def _work(packed: bytes, index: int) -> None:
    """Run one of the processes. SIGTERM acts like Ctrl-C, so that open trials are marked as failed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    silence_pybullet()
    from smartmesh_ros.tools.tune.session import take_part

    request: Request = pickle.loads(packed)
    try:
        take_part(request, None if request.seed is None else request.seed + 1 + index, lambda _: None)
    except KeyboardInterrupt:
        return
