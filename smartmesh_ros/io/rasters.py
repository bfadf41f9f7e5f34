"""Surfaces as others keep them - grid maps, images, occupancy grids, organised clouds - as geometry and heights.

Pure functions from arrays to a `Raster`, whose rows run along +y and columns along +x as in `GridGeometry`. What cannot
be a surface raises `InputError`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import GridGeometry

FloatGrid = NDArray[np.float32]
FirstRow = Literal["top", "bottom"]

# How far a point of an organised cloud may lie from its place on the grid, as a share of a cell. A height there
# is taken as the height at the place.
GRID_TOLERANCE = 0.1
# Points that lie in one line do not say where a grid lies; their normal equations are this badly conditioned.
MAX_CONDITION = 1e12


class Raster(NamedTuple):
    """Where a surface lies, its heights (rows, columns) [m], NaN = no ground, and the variances of these [m^2], None =
    not told."""

    geometry: GridGeometry
    heights: FloatGrid
    variances: FloatGrid | None = None


@dataclass(frozen=True, kw_only=True)
class RasterConfig:
    """How values become heights, ``scale`` x value + ``offset`` [m], and where surfaces that do not say so lie.

    ``layer``: the layer of a grid map that holds heights, ``variance_layer``: the one that holds their variances [m^2
    before scaling], empty = none. ``resolution`` [m], ``origin`` (x, y, z) [m] of the sample in the bottom left
    corner, and ``yaw`` [rad] place images and plain files; ``first_row`` says whether their first row is at the top
    (the largest y) or at the bottom. ``zero_is_hole``: in images and plain files zero means no ground.
    """

    layer: str = "elevation"
    variance_layer: str = ""
    scale: float = 1.0
    offset: float = 0.0
    resolution: float = 0.1
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    first_row: FirstRow = "top"
    zero_is_hole: bool = False

    def __post_init__(self) -> None:
        for name in ("scale", "offset", "yaw"):
            if not math.isfinite(getattr(self, name)):
                raise InputError("parameter", f"{name} is {getattr(self, name)}; it must be a finite number")
        if len(self.origin) != 3 or not all(math.isfinite(value) for value in self.origin):
            raise InputError("parameter", f"the origin is {self.origin}; it must be three finite numbers [m]")


def scaled(values: NDArray[Any], config: RasterConfig) -> FloatGrid:
    """Values as heights [m]; what is not finite is a hole."""
    with np.errstate(over="ignore", invalid="ignore"):  # becomes infinity or NaN, and so a hole
        heights = values.astype(np.float32)
        if config.scale != 1.0:
            heights *= np.float32(config.scale)
        if config.offset != 0.0:
            heights += np.float32(config.offset)
        if not np.isfinite(heights.sum()):
            heights[~np.isfinite(heights)] = np.nan
    return heights


def from_image(values: NDArray[Any], config: RasterConfig) -> Raster:
    """A picture of heights (rows, columns), placed by the configuration."""
    if values.ndim != 2:
        raise InputError("length", f"the picture has shape {values.shape}; heights need one channel: (rows, columns)")
    heights = scaled(values, config)
    if config.zero_is_hole:
        heights[values == 0] = np.nan
    if config.first_row == "top":
        heights = heights[::-1]
    geometry = GridGeometry(
        rows=heights.shape[0],
        columns=heights.shape[1],
        resolution=config.resolution,
        origin=config.origin,
        yaw=config.yaw,
    )
    return Raster(geometry, np.ascontiguousarray(heights))


def from_grid_map(
    cells: NDArray[Any],
    *,
    start: tuple[int, int],
    centre: tuple[float, float],
    resolution: float,
    config: RasterConfig,
    variances: NDArray[Any] | None = None,
) -> Raster:
    """A layer of a grid map: ``cells`` (along -x, along -y), whose first row and column in space is ``start``, and one
    of ``variances``.

    A grid map's storage is a circular buffer: it scrolls by moving ``start``, and its cells stay where they are.
    ``centre`` (x, y) [m] is the middle of the map; heights belong to the middles of cells.
    """
    along_x, along_y = cells.shape
    if not (0 <= start[0] < along_x and 0 <= start[1] < along_y):
        raise InputError("region", f"the circular buffer starts at {start}, outside its {along_x} x {along_y} cells")
    heights = scaled(_unrolled(cells, start), config)
    certainty = None if variances is None else np.float32(config.scale**2) * _unrolled(variances, start)
    x = centre[0] - 0.5 * (along_x - 1) * resolution
    y = centre[1] - 0.5 * (along_y - 1) * resolution
    geometry = GridGeometry(rows=along_y, columns=along_x, resolution=resolution, origin=(x, y, 0.0))
    return Raster(geometry, heights, certainty)


def _unrolled(cells: NDArray[Any], start: tuple[int, int]) -> NDArray[Any]:
    """Cells of a grid map (along -x, along -y) as rows along +y and columns along +x."""
    return np.ascontiguousarray(np.roll(cells, (-start[0], -start[1]), (0, 1))[::-1, ::-1].T)


def occupancy_heights(cells: NDArray[np.int8], config: RasterConfig) -> FloatGrid:
    """Occupancy in percent as heights: ``scale`` metres where it is certain, and no ground where it is unknown (-1)."""
    if cells.size and cells.max() > 100:
        raise InputError("occupancy", f"occupancy {cells.max()} % is not possible; it is 0 to 100, or -1 for unknown")
    heights = scaled(cells.astype(np.float32) / np.float32(100.0), config)
    heights[cells < 0] = np.nan
    return heights


def from_cells(heights: FloatGrid, *, corner: tuple[float, float, float], yaw: float, resolution: float) -> Raster:
    """Heights of cells (rows, columns) from the outer ``corner`` of the first; samples lie in their middles."""
    cos, sin, half = math.cos(yaw), math.sin(yaw), 0.5 * resolution
    origin = (corner[0] + half * (cos - sin), corner[1] + half * (sin + cos), corner[2])
    rows, columns = heights.shape
    return Raster(GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=origin, yaw=yaw), heights)


def from_points(points: NDArray[np.float64], config: RasterConfig) -> Raster:
    """An organised cloud (rows, columns, 3) [m] whose points lie over a uniform grid; NaN points are holes."""
    with np.errstate(all="ignore"):
        known = np.isfinite(points.sum(axis=2))
    fit = _fitted_grid(points, known)
    along_columns, along_rows = fit[1], fit[2]
    resolution = float(np.hypot(*along_columns))
    mirrored = bool(along_columns[0] * along_rows[1] < along_columns[1] * along_rows[0])
    turned = np.array([-along_columns[1], along_columns[0]]) * (-1.0 if mirrored else 1.0)
    rows, columns = known.shape
    off = 0.0
    for axis in range(2):
        places = fit[0, axis] + along_columns[axis] * np.arange(columns) + turned[axis] * np.arange(rows)[:, None]
        off = max(off, float(np.abs(places - points[..., axis]).max(where=known, initial=0.0)))
    if not off <= GRID_TOLERANCE * resolution:
        raise InputError(
            "not_a_grid",
            f"points of the cloud lie up to {off:.3g} m off a grid of {resolution:.3g} m; rows and columns must be "
            "equally spaced and square to each other in x and y",
        )
    heights = scaled(points[..., 2], config)
    heights[~known] = np.nan
    first = fit[0]
    if mirrored:
        first = first + (rows - 1) * turned
        heights = np.ascontiguousarray(heights[::-1])
    geometry = GridGeometry(
        rows=rows,
        columns=columns,
        resolution=resolution,
        origin=(float(first[0]), float(first[1]), 0.0),
        yaw=math.atan2(along_columns[1], along_columns[0]),
    )
    return Raster(geometry, heights)


def _fitted_grid(points: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(x, y) of the first sample, a step along columns and a step along rows, (3, 2) [m], that fit the known points
    best: the normal equations, whose sums over rows and columns cost a few passes over the cloud."""
    rows, columns = known.shape
    # About the middle of the grid and one of the points, for the sake of precision.
    r, c = np.arange(rows) - 0.5 * (rows - 1), np.arange(columns) - 0.5 * (columns - 1)
    some = np.unravel_index(np.argmax(known), known.shape)
    in_row, in_column = known.sum(axis=1), known.sum(axis=0)
    sum_c, sum_r, sum_rc = in_column @ c, in_row @ r, r @ (known @ c)
    normal = np.array(
        [[in_row.sum(), sum_c, sum_r], [sum_c, in_column @ c**2, sum_rc], [sum_r, sum_rc, in_row @ r**2]], np.float64
    )
    if not np.linalg.cond(normal) < MAX_CONDITION:
        raise InputError("not_a_grid", "the cloud has too few finite points to say where its grid lies; it needs three")
    right = np.empty((3, 2))
    for axis in range(2):
        offsets = np.where(known, points[..., axis] - points[some][axis], 0.0)
        right[:, axis] = offsets.sum(), offsets.sum(axis=0) @ c, offsets.sum(axis=1) @ r
    fit = np.asarray(np.linalg.solve(normal, right), np.float64)
    fit[0] += points[some][:2] + c[0] * fit[1] + r[0] * fit[2]
    return fit
