"""As much ground as a body needs: none, a plane, or the patch with the fewest samples that is near enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.facets import facet_deviation, facets_of
from smartmesh_ros.patches.grid_window import SIZES, Balls, Window
from smartmesh_ros.patches.planes import (
    ALL_NINE,
    Planes,
    as_planes,
    facet_nearest,
    near_deviation,
    planes_through,
    rings_touched,
)
from smartmesh_ros.patches.strides import HYSTERESIS, cheapest_extents
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# What a body stands on, as numbers in arrays; FIXED: a patch of as many rings as its size asks for, unlooked at.
UNDECIDED, NONE, FACET, FITTED, FIELD, FIXED = -1, 0, 1, 2, 3, 4

# How far above the ground a body loses its collider, beyond what it may move [m].
LEAVING = 0.002

# A patch keeps its size while the body needs more than this share of it, and for so many looks in any case: changing
# it costs more than some samples.
ROOMY, LOOKS = 0.6, 4

# Where only the cells around one sample can be touched, the facet under the body is the plane; else one fitted to many.
FACET_RINGS = 1
# In windows so small the facet under the body also tells how the ground runs.
SMALL_WINDOW = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """What n bodies get, shapes (n,): what to stand on (see above), rings and stride of the patch, how far it lies from
    the mesh where the body can touch it, at most [m]; a plane along the ground under the body at each of t instants,
    one after the other (t n,); which facet it is (n,), as by `facet_under`, or `ALL_NINE`; for how many looks on end a
    smaller patch would have done (n,)."""

    state: IntArray
    rings: IntArray
    stride: IntArray
    deviation: FloatArray
    planes: Planes
    facets: IntArray
    spare: IntArray

    def planes_at(self, instant: int) -> Planes:
        """The planes at one of the instants."""
        count = len(self.state)
        return self.planes.of(slice(instant * count, (instant + 1) * count))


def choose(
    window: Window,
    balls: Balls,
    lean: FloatArray,
    config: PatchConfig,
    state: IntArray,
    rings: IntArray,
    stride: IntArray,
    spare: IntArray,
) -> Choice:
    """Chooses for n bodies.

    ``lean`` (n, 2) [m]: horizontal offset of each body's middle from the point of the ground that is nearest to it, as
    far as known. ``state``, ``rings``, ``stride``, ``spare`` (n,): what they have now. A cheaper collider must keep a
    share of the tolerance [m], so that no body changes back and forth.
    """
    count = len(state)
    small = window.rings <= SMALL_WINDOW
    facet, planes = _facets_under(window, balls, lean) if small else _fits_under(window, balls)
    now = planes.of(slice(count))
    need = rings_touched(window, now, balls)
    covered = np.where((state == FIELD) | (state == NONE), rings * stride, 0)
    smaller = (need < covered) & (covered <= window.rings)
    roomy = smaller & (need > 0) & ((need > ROOMY * covered) | (spare < LOOKS))
    # Who is below the ground touches none of it, but has to be found there.
    kept = _leaving(need, now, balls, state) | ((need == 0) & (now.above(balls.centres) < 0.0))
    need = np.where(kept, 1, np.where(roomy, covered, need))
    choice = Choice(
        state=np.where(need == 0, NONE, FIELD), rings=np.where(need == 0, rings, 1),
        stride=np.where(need == 0, stride, 1), deviation=np.zeros(count), planes=planes, facets=facet,
        spare=np.where(smaller, spare + 1, 0),
    )  # fmt: skip
    limit = np.where((state == FACET) | (state == FITTED), 1.0, HYSTERESIS) * config.plane_tolerance
    few = np.flatnonzero(need <= FACET_RINGS)
    # In small windows of moving ground facets seldom pass as planes: trying them costs more than it saves.
    planar = window.instants == 1 or not small or config.kind == "plane"
    if few.size and planar:
        inner, touching = window.inner(few, FACET_RINGS), balls.of(few)
        if small:
            under = planes.of(_repeated(few, count, window.instants))
        else:
            choice.facets[few], under = _facets_under(inner, touching, lean[few])
        deviation = facet_deviation(facets_of(inner), under, touching.repeated(window.instants))
        _take_planes(choice, few, window, under, deviation, limit, FACET, np.ones_like(few))
    if few.size < count:
        many = np.flatnonzero((need > FACET_RINGS) & (_bend(window, need) <= limit))
        sizes = SIZES[np.searchsorted(SIZES, need[many])]
        for size in np.unique(sizes).tolist():
            _stand_on_fits(choice, many[sizes == size], size, need, window, balls, limit)
    field = np.flatnonzero(choice.state == FIELD)
    if field.size:
        extents = cheapest_extents(window, field, need[field], config.tolerance, rings[field], stride[field])
        choice.rings[field], choice.stride[field] = extents.rings, extents.stride
        choice.deviation[field] = extents.deviation
    return choice


def _leaving(need: IntArray, planes: Planes, balls: Balls, state: IntArray) -> BoolArray:
    """Which bodies just left the ground (n,): they keep a collider, so that none changes back and forth."""
    distance = planes.above(balls.centres) / planes.steepness()
    return np.asarray((need == 0) & (state > NONE) & (distance <= balls.radii + LEAVING))


def _facets_under(window: Window, balls: Balls, lean: FloatArray) -> tuple[IntArray, Planes]:
    """Which of the facets around the middles of windows the bodies stand on (n,), and its planes (t n,)."""
    count, resolution = len(balls.radii), window.resolution
    nine = window.inner(np.arange(count), FACET_RINGS).heights.reshape(window.instants, count, 9)
    which = facet_nearest(nine[0], balls.centres, lean, resolution, holes=window.holes)
    planes = as_planes(planes_through(nine, which, resolution, holes=window.holes))
    _fill_holes(planes, window, balls)
    return which, planes


def _fits_under(window: Window, balls: Balls) -> tuple[IntArray, Planes]:
    """Planes (t n,) fitted to the ground around the middles of windows; they are no facets'."""
    # From the body's size alone: what a plane leads to must not lead to another plane.
    stride = np.minimum((0.25 * balls.radii / window.resolution).astype(np.int64) + 1, window.rings)
    planes = _fitted(window, stride)
    _fill_holes(planes, window, balls)
    return np.full(len(stride), ALL_NINE), planes


def _fill_holes(planes: Planes, window: Window, balls: Balls) -> None:
    """Puts level planes through the bodies where a hole leaves none."""
    if window.holes:
        hole = np.flatnonzero(np.isnan(planes.height))
        planes.height[hole] = balls.centres[hole % len(balls.radii), 2]
        planes.slope_x[hole] = planes.slope_y[hole] = 0.0


def _bend(window: Window, need: IntArray) -> FloatArray:
    """How far any plane lies at least (n,) [m] from one of three samples in a row or in a column, apart by half of what
    each body needs, ``need`` (n,) [rings]; NaN where one is a hole."""
    heights, middle, body = window.heights[0], window.rings, np.arange(len(need))
    aside = np.maximum(need // 2, 1)
    twice = 2.0 * heights[:, middle, middle]
    row = heights[body, middle, middle - aside] + heights[body, middle, middle + aside] - twice
    column = heights[body, middle - aside, middle] + heights[body, middle + aside, middle] - twice
    return np.asarray(0.25 * np.maximum(np.abs(row), np.abs(column)))


def _stand_on_fits(
    choice: Choice, rows: IntArray, size: int, need: IntArray, window: Window, balls: Balls, limit: FloatArray
) -> None:
    """Chooses a plane fitted to the ground under the body where that is near enough to all that it can touch."""
    inner = window.inner(rows, size)
    stride = np.maximum(need[rows] // 2, 1)
    planes = _fitted(inner, stride)
    deviation = near_deviation(inner, planes, balls.of(rows).repeated(inner.instants))
    _take_planes(choice, rows, inner, planes, deviation, limit, FITTED, stride)


def _take_planes(
    choice: Choice,
    rows: IntArray,
    window: Window,
    planes: Planes,
    deviation: FloatArray,
    limit: FloatArray,
    state: int,
    stride: IntArray,
) -> None:
    """Notes the ``planes`` (t m,) under bodies in ``rows`` (m,), and chooses them where they deviate little enough."""
    repeated = _repeated(rows, len(choice.state), window.instants)
    for values, new in zip(choice.planes, planes, strict=True):
        values[repeated] = new
    deviation = window.worst(deviation + 0.0 * planes.height)  # a plane over a hole is none
    flat = (deviation <= limit[rows]) & (choice.state[rows] != NONE)
    taken = rows[flat]
    choice.state[taken] = state
    choice.deviation[taken] = deviation[flat]
    choice.stride[taken] = stride[flat]


def _repeated(rows: IntArray, count: int, instants: int) -> IntArray | slice:
    """Where the bodies in ``rows``, of ``count``, are among all instants one after the other."""
    if len(rows) == count:
        return slice(None)
    return rows if instants == 1 else np.concatenate([rows + instant * count for instant in range(instants)])


def _fitted(window: Window, stride: IntArray) -> Planes:
    """Planes (t n,) through the 3 x 3 samples that are ``stride`` (n,) samples apart around the middle of windows."""
    step = window.rings + stride[:, None] * np.array([-1, 0, 1])
    body = np.arange(len(stride))[:, None, None]
    nine = window.heights[:, body, step[:, :, None], step[:, None, :]].reshape(window.instants, -1, 9)
    all_nine = np.full(len(stride), ALL_NINE)
    return as_planes(planes_through(nine, all_nine, stride * window.resolution, holes=window.holes))
