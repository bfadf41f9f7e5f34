"""The ground under the middle of bodies, with whose motion the report's colliders move between refreshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.report.supports import Support
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap


def write_feet(
    heightmap: HeightMap, chosen: IntArray, places_w: FloatArray, heights: FloatArray, velocities: FloatArray,
    time: float, supports: Any,
) -> None:  # fmt: skip
    """Write foot and motion of the ground into the ``supports`` (S,) of the bodies ``chosen`` (n,) at ``places_w``
    (n, 2+) [m], from the samples (n, side, side) of their squares; no support where all are holes."""
    side, found, geometry = heights.shape[1], supports[chosen], heightmap.placed_at(time)
    first = np.stack([found["row"], found["column"]], axis=1)
    place = np.clip((geometry.to_grid(places_w[:, :2]) - first) / found["stride"][:, None], 0.0, side - 1.0)
    row, column = np.minimum(place.astype(np.int64), side - 2).T
    v, u = place[:, 0] - row, place[:, 1] - column
    size = geometry.resolution * found["stride"]
    z, _, _ = _in_facet(heights, row, column, u, v)
    rise, along, down = _in_facet(velocities, row, column, u, v)
    holes = np.isnan(z)
    if holes.any():
        known = ~np.isnan(heights[holes])
        count = np.maximum(known.sum(axis=(1, 2)), 1)
        z[holes] = np.where(known, heights[holes], 0.0).sum(axis=(1, 2)) / count
        rise[holes] = np.where(known, np.nan_to_num(velocities[holes]), 0.0).sum(axis=(1, 2)) / count
        along[holes] = down[holes] = 0.0
    x, y, cos, sin, slide_x, slide_y, spin = CORE.grid_pose(heightmap.core_reader, time)
    east, north = (along * cos - down * sin) / size, (along * sin + down * cos) / size
    values = {
        "foot_x": places_w[:, 0], "foot_y": places_w[:, 1], "foot_z": z, "rise": rise, "turn_x": north,
        "turn_y": -east, "turn_z": spin, "slide_x": slide_x - spin * (places_w[:, 1] - y),
        "slide_y": slide_y + spin * (places_w[:, 0] - x),
        "state": np.where(np.isfinite(heights).any(axis=(1, 2)), Support.FIELD, Support.NONE),
    }  # fmt: skip
    for name, value in values.items():
        supports[name][chosen] = value


def _in_facet(
    samples: FloatArray, row: IntArray, column: IntArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values (n,) in the facet of a cell at ``u``, ``v``, and their changes per column and per row."""
    n, below = np.arange(len(samples)), u < v
    a, e = samples[n, row, column], samples[n, row + 1, column + 1]
    b = np.where(below, samples[n, row + 1, column], samples[n, row, column + 1])
    along, down = np.where(below, e - b, b - a), np.where(below, b - a, e - b)
    return a + along * u + down * v, along, down
