"""Undoes half of an operation when the other half fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def undone(undo: Callable[[], object]) -> Iterator[None]:
    """Call ``undo`` if the block raises, and let its error pass."""
    try:
        yield
    except BaseException:
        undo()
        raise
