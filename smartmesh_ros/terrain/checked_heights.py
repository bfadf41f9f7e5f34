"""Checks of the heights, velocities and variances that a map is given."""

from __future__ import annotations

import math
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float, is_number, require

# Latest time, and earliest below zero [s]: motions over longer times overflow.
LATEST = 1e12


def checked_time(time: float) -> float:
    """Return a time [s]; raises `InputError` if it is no number up to `LATEST`."""
    seconds = as_float(time)
    if not -LATEST <= seconds <= LATEST:
        raise InputError("time", f"the time is {time!r}; it must be a finite number of seconds, up to {LATEST:g}")
    return seconds


def checked_next_time(time: float, last: float) -> float:
    """Return the time [s] of an update; raises `InputError` if it is before that of the ``last`` one [s]."""
    seconds = checked_time(time)
    if seconds < last:
        raise InputError(
            "time", f"an update of {seconds:g} s comes after one of {last:g} s; after the time was set back, call "
            "shift_time of the map or the terrain, or make a new map"
        )  # fmt: skip
    return seconds


def checked_place(row: int, column: int, region: tuple[int, ...], size: tuple[int, int]) -> tuple[int, int]:
    """Return the first sample of a region of a shape (h, w); raises `InputError` unless the region lies in a map of a
    ``size`` (rows, columns)."""
    try:
        row, column = index(row), index(column)
    except TypeError:
        raise InputError("region", f"row {row!r} and column {column!r} must be whole numbers") from None
    if len(region) != 2 or 0 in region:
        raise InputError("length", f"a region needs (rows, columns) of at least 1 x 1 samples, not {region}")
    rows, columns = size
    if row < 0 or column < 0 or row + region[0] > rows or column + region[1] > columns:
        raise InputError(
            "region",
            f"rows {row} to {row + region[0] - 1} and columns {column} to {column + region[1] - 1} leave the map, "
            f"whose last sample is row {rows - 1}, column {columns - 1}",
        )
    return row, column


def checked_numbers(indices: ArrayLike) -> NDArray[np.int64]:
    """Return numbers of samples or vertices as int64 of the same shape. Raises `InputError` unless they are whole."""
    array = unmasked(indices, "indices")
    if array.dtype.kind not in "iu":
        raise InputError("type", f"indices are of type {array.dtype}; they must be whole numbers")
    return np.ascontiguousarray(array, np.int64)


def checked_ahead(ahead: float) -> float:
    """Return the time [s] over which velocities are means; raises `InputError` if it is not above zero."""
    seconds = as_float(ahead)
    require(0.0 < seconds <= LATEST, "time", "the time ahead", ahead, f"above zero, up to {LATEST:g} s")
    return seconds


def checked_variance(variance: float | ArrayLike | None, shape: tuple[int, ...]) -> float | NDArray[np.float32] | None:
    """Return variances as one number or as float32 of the right shape."""
    if variance is None:
        return None
    return float(variance) if is_number(variance) else as_floats(variance, shape, "variances")


def deviation_of(variance: float | NDArray[np.float32]) -> float:
    """Return the root mean square standard deviation [m]; negative and non-finite variances are ignored."""
    known = np.asarray(variance, np.float64)
    known = known[(known >= 0.0) & (known < math.inf)]
    return math.sqrt(known.mean()) if known.size else 0.0


def checked(
    heights: ArrayLike, velocities: ArrayLike | None, shape: tuple[int, ...], what: str
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """Return heights and velocities as float32 of the right shape without infinities, as the core takes them."""
    new = _without_infinity(heights, shape, f"heights of {what}", "mark missing ground with NaN")
    if velocities is None:
        return new, None
    return new, _without_infinity(velocities, shape, f"velocities of {what}", "they must be finite or NaN [m/s]")


def _without_infinity(values: ArrayLike, shape: tuple[int, ...], what: str, instead: str) -> NDArray[np.float32]:
    samples = dense(as_floats(values, shape, what))
    if CORE.has_infinity(samples):
        raise InputError("non_finite", f"{what} contain infinity; {instead}")
    return samples


def dense(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return values as a contiguous and aligned array, as the core takes them."""
    if values.flags.carray:  # `require` takes a microsecond to find that
        return values
    return np.require(values, np.float32, ("C", "A"))


def as_floats(values: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float32]:
    """Return real numbers as float32; raises `InputError` if they have another shape or type."""
    array = unmasked(values, what)
    if array.shape != shape:
        raise InputError("length", f"{what} have shape {array.shape}; it must be {shape}")
    if array.dtype.kind not in "fiu":
        raise InputError("type", f"{what} are of type {array.dtype}; they must be real numbers")
    if array.dtype == np.float32:
        return array
    with np.errstate(over="ignore"):  # too large values become infinity, which is refused
        return array.astype(np.float32, copy=False)


def as_points(points: ArrayLike, widths: tuple[int, ...]) -> NDArray[Any]:
    """Return real numbers as an array (N, w) whose width is allowed; raises `InputError`."""
    array = unmasked(points, "points")
    if array.ndim != 2 or array.shape[1] not in widths or array.dtype.kind not in "fiu":
        shapes = " or ".join(f"(N, {width})" for width in widths)
        raise InputError("length", f"points have shape {array.shape}; they must be real numbers of shape {shapes}")
    return array


def unmasked(values: ArrayLike, what: str = "values") -> NDArray[Any]:
    """Return values as a plain array, in which masked real numbers are NaN. Raises `InputError` if they are no array,
    such as lists of different lengths."""
    if not isinstance(values, np.ma.MaskedArray):
        try:
            return np.asarray(values)
        except ValueError:
            raise InputError("length", f"{what} are no array: all rows must have the same length") from None
    if values.dtype.kind not in "fiu" or not np.ma.getmaskarray(values).any():
        return np.asarray(values.data)
    return np.where(np.ma.getmaskarray(values), np.nan, values.data)
