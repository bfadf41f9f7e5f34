"""Tables with a row for the slot of each body. A body keeps its slot for life, so rows never move."""

from __future__ import annotations

from typing import Any

import numpy as np


def with_rows(array: Any, count: int, initial: Any) -> Any:
    """Return ``array`` with at least ``count`` rows: itself if it has them, otherwise a copy whose further rows are
    ``initial``. The number of rows at least doubles, so that adding bodies one by one costs constant time for each."""
    if len(array) >= count:
        return array
    longer = np.empty((max(count, 2 * len(array)), *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    longer[len(array) :] = initial
    return longer
