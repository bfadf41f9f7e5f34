"""Keeps PyBullet's own words, which it prints past Python, from between the node's."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

# Has ROS log to the standard output, which then stays as it is.
LOGS_TO_STDOUT = "RCUTILS_LOGGING_USE_STDOUT"
STDOUT, STDERR = 1, 2


def silence_pybullet() -> None:
    """From now on only Python prints to the standard output. Works before PyBullet is imported only, because it tells
    its build time then, to the standard error."""
    if os.environ.get(LOGS_TO_STDOUT, "0") != "1":
        sys.stdout.flush()
        sys.stdout = os.fdopen(os.dup(STDOUT), "w", buffering=1)
        with _devnull() as nowhere:
            os.dup2(nowhere, STDOUT)
    import_pybullet_quietly()


def import_pybullet_quietly() -> None:
    """Import PyBullet, which tells its build time then. Leaves the standard output to those who start processes."""
    sys.stderr.flush()
    kept = os.dup(STDERR)
    try:
        with _devnull() as nowhere:
            os.dup2(nowhere, STDERR)
        import pybullet  # noqa: F401
    finally:
        os.dup2(kept, STDERR)
        os.close(kept)


@contextmanager
def _devnull() -> Iterator[int]:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        yield nowhere
    finally:
        os.close(nowhere)
