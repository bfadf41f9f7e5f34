"""Standard output: without what PyBullet's C++ code prints there, and with a quiet end when nobody reads it."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

# If set to 1, ROS logs to standard output, which is then not silenced.
LOGS_TO_STDOUT = "RCUTILS_LOGGING_USE_STDOUT"
STDOUT, STDERR = 1, 2


def silence_pybullet() -> None:
    """Discard what C++ code prints to standard output; Python still prints there. Then import PyBullet quietly. Call
    this before the first import of PyBullet, which prints its build time to standard error."""
    if os.environ.get(LOGS_TO_STDOUT, "0") != "1":
        sys.stdout.flush()
        sys.stdout = os.fdopen(os.dup(STDOUT), "w", buffering=1)
        with _devnull() as nowhere:
            os.dup2(nowhere, STDOUT)
    import_pybullet_quietly()


def import_pybullet_quietly() -> None:
    """Import PyBullet with standard error discarded, because the import prints its build time. Standard output stays
    usable for child processes."""
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
def ending_with_reader() -> Iterator[None]:
    """End the process without an error if the reader of its standard output ends, as in ``command --help | head``."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        if not _reader_has_ended():
            raise
        with _devnull() as nowhere:
            os.dup2(nowhere, sys.stdout.fileno())  # Python flushes once more when it exits
        sys.exit(0)


def _reader_has_ended() -> bool:
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)  # errors are always reported
    return any(events & select.POLLERR for _, events in poll.poll(0))


@contextmanager
def _devnull() -> Iterator[int]:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        yield nowhere
    finally:
        os.close(nowhere)
