"""Conversion of grid maps, images, occupancy grids and organised clouds to geometry and heights.

Pure functions from arrays to a `Raster`, whose rows run along +y and columns along +x as in `GridGeometry`. They raise
`InputError` for invalid input.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError, as_float, require, require_choice, require_flag
from smartmesh_ros.terrain.checked_heights import unmasked
from smartmesh_ros.terrain.grid import GridGeometry, geometry_of
from smartmesh_ros.terrain.material import MOST_SOILS, Material, require_layer

FloatGrid = NDArray[np.float32]
FirstRow = Literal["top", "bottom"]

# Largest horizontal distance of a point of an organised cloud from its sample [cells]. The height of the point becomes
# the height of the sample.
GRID_TOLERANCE = 0.1
# Largest condition number of the normal equations of a grid fit. Points in a line exceed it and define no grid.
MAX_CONDITION = 1e12


class Raster(NamedTuple):
    """Geometry of a surface, its heights (rows, columns) [m], NaN = no ground, their variances [m^2] or None, what is
    known of the material of the ground, and its velocities [m/s] or None = unknown."""

    geometry: GridGeometry
    heights: FloatGrid
    variances: FloatGrid | None = None
    material: Material = Material()
    velocities: FloatGrid | None = None


@dataclass(frozen=True, kw_only=True)
class RasterConfig:
    """Conversion of values to heights, ``scale`` x value + ``offset`` [m], and position of images and plain files.

    ``layer``: layer of a grid map with the heights. ``variance_layer``: layer with their variances [m^2 before
    scaling], empty = none. ``material_layers``: those of the ground's material, as "friction=slip" for the friction in
    the layer slip, or "friction" if it has the same name. ``resolution`` [m], and ``origin`` (x, y, z) [m] of the
    sample in the bottom left corner: of images and plain files.
    ``first_row``: their first row is at the top (the largest y) or at the bottom. ``zero_is_hole``: zero means no
    ground in images and plain files.
    """

    layer: str = "elevation"
    variance_layer: str = ""
    material_layers: tuple[str, ...] = ()
    scale: float = 1.0
    offset: float = 0.0
    resolution: float = 0.1
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    first_row: FirstRow = "top"
    zero_is_hole: bool = False

    def __post_init__(self) -> None:
        for name in ("scale", "offset"):
            number = getattr(self, name)
            require(math.isfinite(as_float(number)), "parameter", name, number, "a finite number")
        require_choice(self.first_row, get_args(FirstRow), "parameter", "first_row")
        require_flag(self.zero_is_hole, "parameter", "zero_is_hole")
        origin = [*map(as_float, self.origin)] if isinstance(self.origin, Iterable) else []
        good = len(origin) == 3 and all(map(math.isfinite, origin))
        require(good, "parameter", "the origin", self.origin, "three finite numbers [m]")
        given = self.material_layers
        good = isinstance(given, tuple | list) and all(isinstance(entry, str) for entry in given)
        require(good, "layer", "material_layers", given, "a list of texts such as 'friction=slip'")
        for entry in given:
            require_layer(entry.split("=")[0])
        if len(self.layers) < len(self.material_layers):
            raise InputError("layer", f"the layers of the material are {self.material_layers}; give each once")

    @property
    def layers(self) -> dict[str, str]:
        """Layers of a grid map by those of the material that they hold."""
        return {name: layer or name for name, _, layer in (entry.partition("=") for entry in self.material_layers)}


def scaled(values: NDArray[Any], config: RasterConfig) -> FloatGrid:
    """Return values as heights [m]; non-finite values become holes."""
    with np.errstate(over="ignore", invalid="ignore"):  # too large values become infinity, and so holes
        heights = unmasked(values).astype(np.float32)
        if config.scale != 1.0:
            heights *= np.float32(config.scale)
        if config.offset != 0.0:
            heights += np.float32(config.offset)
        if not np.isfinite(heights.sum()):
            heights[~np.isfinite(heights)] = np.nan
    return heights


def from_image(values: NDArray[Any], config: RasterConfig) -> Raster:
    """Return an image of heights (rows, columns) as a raster, placed by the configuration."""
    if values.ndim != 2:
        raise InputError("length", f"the image has shape {values.shape}; heights need one channel: (rows, columns)")
    values = unmasked(values)
    heights = scaled(values, config)
    if config.zero_is_hole:
        heights[values == 0] = np.nan
    if config.first_row == "top":
        heights = heights[::-1]
    geometry = geometry_of(heights.shape, config.resolution, config.origin, 0.0)
    return Raster(geometry, np.ascontiguousarray(heights))


def from_grid_map(
    cells: NDArray[Any],
    *,
    start: tuple[int, int],
    centre: tuple[float, float],
    resolution: float,
    config: RasterConfig,
    variances: NDArray[Any] | None = None,
    material: Material | None = None,
) -> Raster:
    """Return a layer ``cells`` (along -x, along -y) of a grid map as a raster, optionally with ``variances`` and a
    ``material``, whose layers are such cells.

    A grid map is a circular buffer: ``start`` is the index of its first cell in space, and scrolling moves ``start``
    instead of the cells. ``centre`` (x, y) [m]: middle of the map. Heights belong to the centres of cells.
    """
    cells, variances = unmasked(cells), None if variances is None else unmasked(variances)
    along_x, along_y = cells.shape
    if not (0 <= start[0] < along_x and 0 <= start[1] < along_y):
        raise InputError("region", f"the circular buffer starts at {start}, outside its {along_x} x {along_y} cells")
    heights = scaled(_unrolled(cells, start), config)
    certainty = None if variances is None else np.float32(config.scale**2) * _unrolled(variances, start)
    x = centre[0] - 0.5 * (along_x - 1) * resolution
    y = centre[1] - 0.5 * (along_y - 1) * resolution
    geometry = geometry_of(heights.shape, resolution, (x, y), 0.0)
    ground = (material or Material()).each(lambda name, layer: from_numbers(name, _unrolled(layer, start)))
    return Raster(geometry, heights, certainty, ground)


def from_numbers(name: str, layer: NDArray[Any]) -> NDArray[Any]:
    """Return a layer of a material from numbers (...); those of soils become places in a list."""
    if name != "soil":
        return layer
    places = np.where(np.isnan(layer), 0.0, layer)
    if not (np.rint(places) == places).all() or not 0.0 <= places.min() <= places.max() < MOST_SOILS:
        most = MOST_SOILS - 1
        raise InputError("soil", f"the layer of soils holds numbers that are no places in a list, 0 to {most}, or NaN")
    return places.astype(np.uint8)


def _unrolled(cells: NDArray[Any], start: tuple[int, int]) -> NDArray[Any]:
    """Return the cells of a grid map (along -x, along -y) as rows along +y and columns along +x."""
    return np.ascontiguousarray(np.roll(cells, (-start[0], -start[1]), (0, 1))[::-1, ::-1].T)


def occupancy_heights(cells: NDArray[np.int8], config: RasterConfig) -> FloatGrid:
    """Return occupancy in percent as heights: ``scale`` metres at 100 %, and no ground where it is unknown (-1)."""
    if cells.size and cells.max() > 100:
        raise InputError("occupancy", f"occupancy {cells.max()} % is not possible; it is 0 to 100, or -1 for unknown")
    heights = scaled(cells.astype(np.float32) / np.float32(100.0), config)
    heights[cells < 0] = np.nan
    return heights


def from_cells(heights: FloatGrid, *, corner: tuple[float, float, float], yaw: float, resolution: float) -> Raster:
    """Return heights of cells (rows, columns) as a raster; ``corner`` [m]: outer corner of the first cell.

    Samples lie at the centres of cells.
    """
    cos, sin, half = math.cos(yaw), math.sin(yaw), 0.5 * resolution
    origin = (corner[0] + half * (cos - sin), corner[1] + half * (sin + cos), corner[2])
    return Raster(geometry_of(heights.shape, resolution, origin, yaw), heights)


def from_points(points: NDArray[np.float64], config: RasterConfig) -> Raster:
    """Return an organised cloud (rows, columns, 3) [m] over a uniform grid as a raster; NaN points become holes."""
    points = unmasked(points)
    with np.errstate(all="ignore"):
        known = np.isfinite(points.sum(axis=2))
    first, along_columns, along_rows = _fitted_grid(points, known)
    resolution = float(np.hypot(*along_columns))
    mirrored = bool(along_columns[0] * along_rows[1] < along_columns[1] * along_rows[0])
    turned = np.array([-along_columns[1], along_columns[0]]) * (-1.0 if mirrored else 1.0)
    rows, columns = known.shape
    off = 0.0
    for axis in range(2):
        places = first[axis] + along_columns[axis] * np.arange(columns) + turned[axis] * np.arange(rows)[:, None]
        off = max(off, float(np.abs(places - points[..., axis]).max(where=known, initial=0.0)))
    if not off <= GRID_TOLERANCE * resolution:
        raise InputError(
            "not_a_grid",
            f"points of the cloud lie up to {off:.3g} m off a grid of {resolution:.3g} m; rows and columns must be "
            "equally spaced and perpendicular to each other in x and y",
        )
    heights = scaled(points[..., 2], config)
    heights[~known] = np.nan
    if mirrored:
        first = first + (rows - 1) * turned
        heights = np.ascontiguousarray(heights[::-1])
    yaw = math.atan2(along_columns[1], along_columns[0])
    return Raster(geometry_of(heights.shape, resolution, first.tolist(), yaw), heights)


def _fitted_grid(points: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return (x, y) of the first sample, a step along columns and a step along rows (3, 2) [m], by least squares.

    The sums of the normal equations are computed by rows and columns, which takes a few passes over the cloud.
    """
    rows, columns = known.shape
    # Indices relative to the middle of the grid, positions relative to one of the points, for precision.
    r, c = np.arange(rows) - 0.5 * (rows - 1), np.arange(columns) - 0.5 * (columns - 1)
    some = np.unravel_index(np.argmax(known), known.shape)
    in_row, in_column = known.sum(axis=1), known.sum(axis=0)
    sum_c, sum_r, sum_rc = in_column @ c, in_row @ r, r @ (known @ c)
    normal = np.array(
        [[in_row.sum(), sum_c, sum_r], [sum_c, in_column @ c**2, sum_rc], [sum_r, sum_rc, in_row @ r**2]], np.float64
    )
    if not np.linalg.cond(normal) < MAX_CONDITION:
        raise InputError(
            "not_a_grid", "the finite points of the cloud do not define a grid; it needs three that are not in a line"
        )
    right = np.empty((3, 2))
    for axis in range(2):
        offsets = np.where(known, points[..., axis] - points[some][axis], 0.0)
        right[:, axis] = offsets.sum(), offsets.sum(axis=0) @ c, offsets.sum(axis=1) @ r
    fit = np.asarray(np.linalg.solve(normal, right), np.float64)
    fit[0] += points[some][:2] + c[0] * fit[1] + r[0] * fit[2]
    return fit
