"""Processes that search together, by way of one storage."""

from __future__ import annotations

import multiprocessing
import pickle
import signal
from time import monotonic, sleep
from typing import TYPE_CHECKING

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.quiet import silence_pybullet

if TYPE_CHECKING:
    from smartmesh_ros.tune.session import Request

# How long processes may take to note that they were interrupted [s].
STOP_TIMEOUT = 20.0


class Workers:
    """``jobs`` processes of one search. A context manager: whatever ends it ends them, and what they found is kept."""

    def __init__(self, request: Request, jobs: int) -> None:
        context = multiprocessing.get_context("spawn")
        # As bytes: a request imports PyBullet where it is unpacked, which then prints its build time.
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
        """Waits a little; whether any is still at work. Raises `InputError` if one has failed."""
        sleep(seconds)
        failed = [process.exitcode for process in self._processes if process.exitcode]
        if failed:
            raise InputError("jobs", f"a process of the search ended with {failed[0]}; its words are above")
        return any(process.is_alive() for process in self._processes)


def _work(packed: bytes, index: int) -> None:
    """One of the processes. SIGTERM comes as Ctrl-C does, so that open trials are given up."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    silence_pybullet()
    from smartmesh_ros.tune.session import take_part

    request: Request = pickle.loads(packed)
    try:
        take_part(request, None if request.seed is None else request.seed + 1 + index, lambda _: None)
    except KeyboardInterrupt:
        return
