"""Masked arrays, with which rasterio and NumPy mark cells without data."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def unmasked(values: ArrayLike) -> NDArray[Any]:
    """Return values as a plain array, in which masked real numbers are NaN."""
    if not isinstance(values, np.ma.MaskedArray):
        return np.asarray(values)
    if values.dtype.kind not in "fiu" or not np.ma.getmaskarray(values).any():
        return np.asarray(values.data)
    return np.where(np.ma.getmaskarray(values), np.nan, values.data)
