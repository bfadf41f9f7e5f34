"""Functions of the core refuse arrays that do not fit, and never write to read-only ones."""

from __future__ import annotations

import pytest

from tests.core import test_row_bindings as rows
from tests.core import test_update_bindings as updates
from tests.core.array_arguments import arrays_of, require_refused, require_writable
from tests.core.test_bindings import SPOILT

ENTRIES = rows.ENTRIES | updates.ENTRIES
ALLOWED = rows.ALLOWED | updates.ALLOWED


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("entry, name", arrays_of(ENTRIES))
def test_arrays_that_do_not_fit_are_refused(entry: str, name: str, how: str) -> None:
    require_refused(ENTRIES[entry], name, how, (entry, name, how) in ALLOWED)


@pytest.mark.parametrize("entry, name", rows.WRITTEN + updates.WRITTEN)
def test_arrays_that_are_read_only_are_not_written(entry: str, name: str) -> None:
    require_writable(ENTRIES[entry], name)
