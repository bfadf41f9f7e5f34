"""Who is in the air stays there for as long as nothing of the ground around can come up to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.collect import CollectMethod
from smartmesh_ros.patches.grid_collect import collect_inside
from smartmesh_ros.patches.grid_window import window_rings
from smartmesh_ros.patches.ranges import MORE_STEPS, NEARBY, rings_to_edge, sizes_together
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.search.grid import Cells, nearest_vertices
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# For so long moving ground is trusted not to come up to a body [s], if it accelerates by no more than this [m/s^2].
TRUSTED, UPWARD = 0.1, 40.0


class Aloft(NamedTuple):
    """Of n bodies, shapes (n,): how much nearer to the ground they may come and how far aside they may go [m] with no
    ground to touch, not above zero = no further; for how long [s], inf = the ground is at rest; the vertical velocity
    [m/s] of the ground below; and the window of so many rings around the sample in this row and column that says so."""

    above: FloatArray
    aside: FloatArray
    lasts: FloatArray
    rise: FloatArray
    rings: IntArray
    cells: Cells


def aloft(
    heightmap: HeightMap, grid: FloatArray, bottoms_w: FloatArray, radii: FloatArray, along: FloatArray, time: float,
    method: CollectMethod,
) -> Aloft:  # fmt: skip
    """The room around n bodies at fractional (row, column) ``grid`` (n, 2) whose lowest points are at ``bottoms_w``
    (n,) [m], with bounding ``radii`` (n,) [m], that go ``along`` (n,) [m] until the next update.

    Half of what there is above moving ground is left to the ground's motion: it comes up at the velocity of the
    window's fastest sample, and faster by `UPWARD`, while that below the body may sink.
    """
    geometry, count = heightmap.geometry, len(radii)
    cells = nearest_vertices(geometry, grid)
    rings = window_rings((1.0 + NEARBY) * radii + MORE_STEPS * along, geometry.resolution)
    inside = rings_to_edge(geometry, cells) >= rings
    found = Aloft(np.full(count, -np.inf), np.zeros(count), np.full(count, np.inf), np.zeros(count), rings, cells)
    sizes = sizes_together(geometry, cells, np.where(inside, rings, 0))
    for size in np.unique(sizes[inside]).tolist():
        rows = np.flatnonzero(sizes == size)
        template, part = patch_template(size), Cells(cells.rows[rows], cells.columns[rows])
        ground = collect_inside(heightmap, template, part, np.ones_like(rows), time, method)
        tops = ground.heights.max(axis=1)  # NaN over a hole, which leaves no room
        above = bottoms_w[rows] - tops
        offset = np.abs(grid[rows] - np.stack(part, axis=1)).max(axis=1)
        found.aside[rows] = (size - offset) * geometry.resolution - radii[rows]
        if ground.velocities is not None and ground.velocities.any():
            above *= 0.5
            rise = ground.velocities[:, template.centre]
            speed = np.maximum(ground.velocities.max(axis=1), 0.0) - np.minimum(rise, 0.0)
            lasts = (np.sqrt(speed * speed + 2.0 * UPWARD * np.maximum(above, 0.0)) - speed) / UPWARD
            found.lasts[rows], found.rise[rows] = np.minimum(lasts, TRUSTED), rise
        found.above[rows], found.rings[rows] = np.nan_to_num(above, nan=-np.inf), size
    return found
