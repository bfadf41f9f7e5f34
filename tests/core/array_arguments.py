"""Arguments of the core's functions, and what is spoilt in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.core.test_bindings import REFUSED, SPOILT

Arguments = dict[str, Any]
# Ways of spoiling an array that leave a list of fewer items.
FEWER = ("one row fewer", "one column fewer", "empty", "empty rows")


class Entry(NamedTuple):
    """A function of the core, and what makes its arguments anew."""

    function: Callable[..., Any]
    made: Callable[[], Arguments]


def arrays_of(entries: Mapping[str, Entry]) -> list[tuple[str, str]]:
    """Returns the names of entries with those of their arguments that are arrays."""
    return [(entry, name) for entry in entries for name, value in entries[entry].made().items() if is_array(value)]


def is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray)


def is_no_change(array: np.ndarray, how: str) -> bool:
    """Returns True if an array is as good after it was spoilt."""
    return (how == "Fortran order" and array.ndim == 1) or (how == "other precision" and array.dtype == np.int64)


def require_refused(entry: Entry, name: str, how: str, allowed: bool) -> None:
    """Fails if the entry takes a spoilt argument that is not allowed, or refuses one that is."""
    given = entry.made()
    if allowed or is_no_change(given[name], how):
        entry.function(**given | {name: SPOILT[how](given[name])})
        return
    with pytest.raises(REFUSED):  # also of NumPy, of an array that is too large even without memory
        entry.function(**given | {name: SPOILT[how](given[name])})


def require_writable(entry: Entry, name: str) -> None:
    """Fails if the entry takes an array that it writes to although it is read-only."""
    given = entry.made()
    given[name].setflags(write=False)
    with pytest.raises(REFUSED):
        entry.function(**given)
