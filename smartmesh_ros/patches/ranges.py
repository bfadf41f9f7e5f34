"""How much ground a look shows, and how far bodies may go on it until the next."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.choice import FACET, FIELD, FITTED, SMALL_WINDOW, Choice
from smartmesh_ros.patches.grid_collect import Collected
from smartmesh_ros.patches.grid_window import Balls, Window
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, GridGeometry, IntArray

# A choice holds for so many updates where the ground moves, or for fewer where its velocity changes.
HORIZON, SHORT_HORIZON = 8, 4
# For how many updates of travel a look holds: more while that is no further than this share of the body's radius.
STEPS, MORE_STEPS, NEARBY = 4.0, 8.0, 0.1
# Beyond what its speed says, a body may come nearer to the ground by this [m] and slide so far [radii].
SLACK, ROOM = 0.0005, 0.02
# How far bodies may roam on a patch of ground at rest, if so many rings are enough [radii].
ROAM, WIDEST = 1.0, 4
# Going through windows size by size costs as much as so many samples for each further size.
SAMPLES_PER_SIZE = 20_000


def roaming_reach(reach: FloatArray, radii: FloatArray, resolution: float) -> FloatArray:
    """The reach (n,) [m] that shows bodies as much ground at rest as they may roam on."""
    return np.asarray(np.maximum(reach, np.minimum(reach + ROAM * radii, (WIDEST - 0.5) * resolution)))


def roaming_room(
    choice: Choice, radii: FloatArray, centres: FloatArray, slide: FloatArray, window: Window, hurried: BoolArray
) -> FloatArray:
    """How far bodies may slide (n,) [m], at least ``slide`` (n,) [m], on patches of ground at rest that leave no sample
    out, 0 = on none; those are made as wide as it takes. Wherever a body is over such a patch, it is all that the body
    can touch: who would soon have left its plane, ``hurried`` (n,), gets one instead."""
    full = radii + np.abs(centres[:, :2]).max(axis=1)
    wide = np.minimum(np.ceil((full + ROAM * radii) / window.resolution), min(window.rings, WIDEST)).astype(np.int64)
    room = wide * window.resolution - full
    fit = (choice.state == FIELD) & (choice.stride == 1)
    fit |= hurried & ((choice.state == FACET) | (choice.state == FITTED))
    fit &= room >= slide
    choice.state[fit], choice.rings[fit], choice.stride[fit], choice.deviation[fit] = FIELD, wide[fit], 1, 0.0
    return np.where(fit, room, 0.0)


def room_on_planes(
    window: Window, choice: Choice, balls: Balls, centres: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """How far bodies may slide (n,) [m] before they touch ground at rest that is not shown to lie along the plane that
    was chosen for them, 0 = no plane, or not all of the window lies along it; and how far it all deviates (n,) [m]."""
    planes, places = choice.planes_at(0), window.places()
    off = window.heights[0] - planes.height[:, None, None] - planes.slope_x[:, None, None] * places
    off -= planes.slope_y[:, None, None] * places[:, None]
    deviation = np.abs(off, out=off).max(axis=(1, 2))
    along = ((choice.state == FACET) | (choice.state == FITTED)) & (deviation <= tolerance)
    room = places[-1] - np.abs(centres[:, :2]).max(axis=1) - balls.radii
    return np.where(along, np.clip(room, 0.0, balls.radii), 0.0), deviation


def leeway(across: FloatArray, along: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How much nearer to the ground bodies may come and how far they may slide along it before the next look (n,) [m],
    that come ``across`` and go ``along`` (n,) [m] until the next update."""
    return SLACK + _travel(across, radii), ROOM * radii + _travel(along, radii)


def _travel(step: FloatArray, radii: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(STEPS * step, np.minimum(MORE_STEPS * step, NEARBY * radii)))


def window_of(geometry: GridGeometry, size: int, ground: Collected, ahead: FloatArray) -> Window:
    """Windows of ``size`` rings from what was collected, now and, if the ground moves, ``ahead`` (n,) [s] later."""
    side, heights = 2 * size + 1, ground.heights[None]
    if ground.velocities is not None:
        heights = np.empty((2, *ground.heights.shape))
        heights[0] = ground.heights
        np.multiply(ground.velocities, ahead[:, None], out=heights[1])
        heights[1] += ground.heights
    heights = heights.reshape(len(heights), -1, side, side)
    return Window(heights=heights, rings=size, resolution=geometry.resolution, holes=ground.holes)


def sizes_together(geometry: GridGeometry, cells: Cells, rings: IntArray) -> IntArray:
    """Sizes of windows around ``cells`` that show at least so many ``rings`` (n,), 0 = none: of one size where that
    costs less than going through them size by size."""
    sizes = rings.copy()
    sizes[(rings > 0) & (rings <= SMALL_WINDOW)] = SMALL_WINDOW
    large = sizes[rings > SMALL_WINDOW]
    if large.size:
        most, several = int(large.max()), int(np.unique(large).size - 1)
        further = large.size * (2 * most + 1) ** 2 - int(((2 * large + 1) ** 2).sum())
        if several and further <= several * SAMPLES_PER_SIZE:
            sizes[rings > SMALL_WINDOW] = most
    return np.asarray(np.where(sizes <= rings_to_edge(geometry, cells), sizes, rings))


def rings_to_edge(geometry: GridGeometry, cells: Cells) -> IntArray:
    """How many rings of samples there are around ``cells`` (n,), negative beyond the map's edge."""
    return np.asarray(np.minimum(np.minimum(cells.rows, geometry.rows - 1 - cells.rows),
                                 np.minimum(cells.columns, geometry.columns - 1 - cells.columns)))  # fmt: skip
