"""No argument makes the core read or write outside an array: what it cannot take, it refuses."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from tests.core.entries import REFUSED, SPOILT
from tests.core.functions import ENTRIES

ARRAYS = [(entry, name) for entry in ENTRIES for name in ENTRIES[entry].arrays()]
# Numbers that are hardly possible, for each type of them.
EXTREMES = {
    "NaN": lambda kind: np.nan,
    "infinite": lambda kind: np.inf,
    "below all": lambda kind: -np.inf,
    "largest": lambda kind: np.finfo(kind).max,
    "least": lambda kind: np.finfo(kind).min,
    "far": lambda kind: 1e18,
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_what_fits_is_taken(entry: str) -> None:
    ENTRIES[entry].function(**ENTRIES[entry].made())


@pytest.mark.parametrize(("entry", "name"), ARRAYS)
def test_arrays_that_do_not_fit_are_refused(entry: str, name: str) -> None:
    for how, spoil in SPOILT.items():
        given = ENTRIES[entry].made()
        try:  # also NumPy refuses an array that is too large even without memory
            spoilt = spoil(given[name])
            ENTRIES[entry].function(**given | {name: spoilt})
        except REFUSED:
            continue
        assert ENTRIES[entry].fits(name, spoilt, given[name]), f"{how}: it must be refused"


def wrong_values(entry: str) -> Iterator[tuple[str, Any]]:
    """Yield arguments with values that must be refused: numbers of rows that are in no table, and numbers and arrays
    that must be finite."""
    named = {name: (-1, count, 2**31 - 1, -(2**31), 2**62, -(2**63)) for name, count in ENTRIES[entry].within}
    for name, values in {**named, **dict.fromkeys(ENTRIES[entry].finite, (np.nan, np.inf, -np.inf))}.items():
        for value in values:
            right = ENTRIES[entry].made()[name]
            if not isinstance(right, np.ndarray):
                yield name, value
            elif right.dtype.kind == "f" or np.iinfo(right.dtype).min <= value <= np.iinfo(right.dtype).max:
                right.flat[-1] = value
                yield name, right


@pytest.mark.parametrize("entry", ENTRIES)
def test_values_that_lead_out_of_a_table_or_are_not_finite_are_refused(entry: str) -> None:
    for name, value in wrong_values(entry):
        with pytest.raises(REFUSED):
            ENTRIES[entry].function(**ENTRIES[entry].made() | {name: value})


@pytest.mark.parametrize("entry", ENTRIES)
def test_arrays_that_are_read_only_are_not_written(entry: str) -> None:
    for name in ENTRIES[entry].written:
        given = ENTRIES[entry].made()
        given[name].setflags(write=False)
        with pytest.raises(REFUSED):
            ENTRIES[entry].function(**given)


@pytest.mark.parametrize("extreme", EXTREMES)
@pytest.mark.parametrize("entry", ENTRIES)
def test_numbers_of_any_size_do_no_harm(entry: str, extreme: str) -> None:
    """In one column of an array, or in all."""
    for name in ENTRIES[entry].arrays():
        right = ENTRIES[entry].made()[name]
        if right.dtype.kind != "f":
            continue
        columns = range(right.shape[-1]) if right.ndim == 2 and right.shape[-1] <= 13 else ()
        for column in (slice(None), *columns):
            given = ENTRIES[entry].made()
            given[name][..., column] = EXTREMES[extreme](right.dtype)
            with suppress(*REFUSED):
                ENTRIES[entry].function(**given)
