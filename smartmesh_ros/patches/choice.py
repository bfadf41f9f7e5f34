"""As much ground as a body needs: none, a plane, or the patch with the fewest samples that is near enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.facets import Facets, facet_deviation, facet_index, facet_planes, facets_of
from smartmesh_ros.patches.grid_window import SIZES, Balls, Window
from smartmesh_ros.patches.planes import Planes, fitted_planes, near_deviation, rings_touched
from smartmesh_ros.patches.strides import HYSTERESIS, cheapest_extents
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# What a body stands on, as numbers in arrays.
UNDECIDED, NONE, FACET, FITTED, FIELD, EDGE = -1, 0, 1, 2, 3, 4

# How far above the ground a body loses its collider, beyond what it may move [m].
LEAVING = 0.002

# A patch keeps its size while the body needs more than this share of it.
ROOMY = 0.6

# Where only the cells around one sample can be touched, the facet under the body is the plane; else one fitted to many.
FACET_RINGS = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """What n bodies get, shapes (n,): what to stand on (see above), rings and stride of the patch, how far it lies from
    the mesh where the body can touch it, at most [m], and a plane along the ground under the body; of FACET, which one
    it is (n, 3), as by `facet_index` in a window of one ring."""

    state: IntArray
    rings: IntArray
    stride: IntArray
    deviation: FloatArray
    planes: Planes
    facets: IntArray


def choose(
    window: Window,
    balls: Balls,
    lean: FloatArray,
    config: PatchConfig,
    state: IntArray,
    rings: IntArray,
    stride: IntArray,
) -> Choice:
    """Chooses for n bodies.

    ``lean`` (n, 2) [m]: horizontal offset of each body's middle from the point of the ground that is nearest to it, as
    far as known. ``state``, ``rings``, ``stride`` (n,): what they have now. A cheaper collider must keep a share of the
    tolerance [m], so that no body changes back and forth.
    """
    planes = _along_ground(window, balls, lean)
    need = _steady(rings_touched(window, planes, balls), planes, balls, state, rings * stride, window.rings)
    count = len(need)
    choice = Choice(
        state=np.where(need == 0, NONE, FIELD),
        rings=np.ones(count, np.int64),
        stride=np.ones(count, np.int64),
        deviation=np.zeros(count),
        planes=planes,
        facets=np.zeros((count, 3), np.int64),
    )
    limit = np.where((state == FACET) | (state == FITTED), 1.0, HYSTERESIS) * config.plane_tolerance
    few = np.flatnonzero(need <= FACET_RINGS)
    if few.size:
        _stand_on_facets(choice, few, window, balls, lean, limit)
    many = need > FACET_RINGS
    if many.any():
        sizes = SIZES[np.searchsorted(SIZES, need)]
        for size in np.unique(sizes[many]).tolist():
            _stand_on_fits(choice, np.flatnonzero(many & (sizes == size)), size, need, window, balls, limit)
    field = np.flatnonzero(choice.state == FIELD)
    if field.size:
        extents = cheapest_extents(window, field, need[field], config.tolerance, rings[field], stride[field])
        choice.rings[field], choice.stride[field] = extents.rings, extents.stride
        choice.deviation[field] = extents.deviation
    return choice


def _steady(need: IntArray, planes: Planes, balls: Balls, state: IntArray, covered: IntArray, most: int) -> IntArray:
    """``need`` where bodies on the border of another choice keep what they have.

    A body that just left the ground keeps its collider, and a patch somewhat too large keeps its size.
    """
    distance = planes.above(balls.centres) / np.sqrt(1.0 + planes.slope_x**2 + planes.slope_y**2)
    leaving = (need == 0) & (state > NONE) & (distance <= balls.radii + LEAVING)
    roomy = (state == FIELD) & (covered <= most) & (need < covered) & (need > ROOMY * covered)
    return np.where(leaving, 1, np.where(roomy, covered, need))


def _along_ground(window: Window, balls: Balls, lean: FloatArray) -> Planes:
    """Planes along the ground under bodies: where windows are small the facet there, else what fits their middle."""
    if window.rings <= 2:
        facets = facets_of(window.inner(slice(None), FACET_RINGS))
        planes = facet_planes(facets, *_facet_below(facets, balls.centres, lean))
    else:
        # From the body's size alone: what a plane leads to must not lead to another plane.
        stride = np.minimum((0.25 * balls.radii / window.resolution).astype(np.int64) + 1, window.rings)
        planes = fitted_planes(_nine(window.heights, stride), stride * window.resolution)
    if window.holes:
        hole = np.isnan(planes.height)
        for values, instead in zip(planes, (balls.centres[hole, 2], 0.0, 0.0), strict=True):
            values[hole] = instead
    return planes


def _facet_below(facets: Facets, centres: FloatArray, lean: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """The facets that bodies stand on, as by `facet_index`."""
    foot = centres[:, :2] - lean
    planes = facet_planes(facets, *facet_index(facets, foot[:, 0], foot[:, 1]))
    # The foot of the perpendicular on that facet's plane lies nearer to where it will be.
    offset = foot_offset(planes, centres)
    foot = centres[:, :2] - (np.nan_to_num(offset) if facets.holes else offset)
    return facet_index(facets, foot[:, 0], foot[:, 1])


def _stand_on_facets(
    choice: Choice, rows: IntArray, window: Window, balls: Balls, lean: FloatArray, limit: FloatArray
) -> None:
    """Chooses the facet under the body where no other that it can touch is far from its plane."""
    inner, near = window.inner(rows, FACET_RINGS), balls.of(rows)
    facets = facets_of(inner)
    facet = _facet_below(facets, near.centres, lean[rows])
    choice.facets[rows] = np.stack(facet, axis=1)
    planes = facet_planes(facets, *facet)
    deviation = facet_deviation(facets, planes, near)
    if inner.ahead is not None:
        later = facets_of(inner.at_next_look())
        np.maximum(deviation, facet_deviation(later, facet_planes(later, *facet), near), out=deviation)
    _take_planes(choice, rows, planes, deviation, limit, FACET, np.ones(len(rows), np.int64))


def _stand_on_fits(
    choice: Choice, rows: IntArray, size: int, need: IntArray, window: Window, balls: Balls, limit: FloatArray
) -> None:
    """Chooses a plane fitted to the ground under the body where that is near enough to all that it can touch."""
    inner, near = window.inner(rows, size), balls.of(rows)
    stride = np.maximum(need[rows] // 2, 1)
    deviation = np.zeros(len(rows))
    planes = []
    for heights in inner.instants:
        planes.append(fitted_planes(_nine(heights, stride), stride * window.resolution))
        np.maximum(deviation, near_deviation(heights, inner, planes[-1], near), out=deviation)
    _take_planes(choice, rows, planes[0], deviation, limit, FITTED, stride)


def _take_planes(
    choice: Choice,
    rows: IntArray,
    planes: Planes,
    deviation: FloatArray,
    limit: FloatArray,
    state: int,
    stride: IntArray,
) -> None:
    for values, new in zip(choice.planes, planes, strict=True):
        values[rows] = new
    flat = (deviation <= limit[rows]) & (choice.state[rows] != NONE) & np.isfinite(planes.height + deviation)
    taken = rows[flat]
    choice.state[taken] = state
    choice.deviation[taken] = deviation[flat]
    choice.stride[taken] = stride[flat]


def foot_offset(planes: Planes, centres: FloatArray) -> FloatArray:
    """Horizontal offset of points (n, 3) from the feet of their perpendiculars on the planes (n, 2) [m]."""
    share = planes.above(centres) / (1.0 + planes.slope_x**2 + planes.slope_y**2)
    return np.stack([-share * planes.slope_x, -share * planes.slope_y], axis=1)


def _nine(heights: FloatArray, stride: IntArray) -> FloatArray:
    """The 3 x 3 samples that are ``stride`` (n,) samples apart around the middle of windows (n, S, S), as (n, 9)."""
    middle = heights.shape[1] // 2
    step = middle + stride[:, None] * np.array([-1, 0, 1])
    body = np.arange(len(heights))[:, None, None]
    nine: FloatArray = heights[body, step[:, :, None], step[:, None, :]].reshape(len(heights), 9)
    return nine
