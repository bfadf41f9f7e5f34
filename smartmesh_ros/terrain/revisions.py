"""Revisions: numbers that tell whether ground has changed since somebody looked."""

from itertools import count

_numbers = count(1)


def next_revision() -> int:
    """A number that no ground has had yet, higher than all before."""
    return next(_numbers)
