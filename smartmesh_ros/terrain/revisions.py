"""Revisions: increasing numbers that identify states of the ground, to detect changes."""

from itertools import count

_numbers = count(1)


def next_revision() -> int:
    """Return a number higher than all revisions before."""
    return next(_numbers)
