"""Array fields of messages."""

from __future__ import annotations

import array

import numpy as np
from numpy.typing import ArrayLike


def floats(values: ArrayLike) -> array.array[float]:
    """Return values for a float32[] field, without converting element by element."""
    result = array.array("f")
    result.frombytes(np.ascontiguousarray(values, np.float32).tobytes())
    return result


def doubles(values: ArrayLike) -> array.array[float]:
    """Return values for a float64[] field, without converting element by element."""
    result = array.array("d")
    result.frombytes(np.ascontiguousarray(values, np.float64).tobytes())
    return result
