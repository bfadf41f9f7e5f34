"""Soil that recovers, flows to the rim and slides down, and the changes of heights that follow."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled, inlined
from smartmesh_ros.soil.layer import Floats, SoilLayer
from smartmesh_ros.soil.pressing import NOWHERE, Press, note_ground, press_all
from smartmesh_ros.terrain.correction import BLOCK_SHIFT
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.moving_grid import MovingGrid, sample_at


class Flow(NamedTuple):
    """Settings of an update's flow: ``share``, ``rim`` and ``slides`` as in `SoilConfig`; ``drop`` [m]: largest
    difference of neighbouring samples at the angle of repose; ``still`` [m], ``farthest`` [m]: smallest change, and
    largest change of samples that rise or have no load, in an update; ``carried`` [m]: largest
    change that a velocity carries, others jump; 0 = the terrain does not move on by velocities."""

    share: float
    rim: int
    slides: int
    drop: float
    still: float
    farthest: float
    carried: float


class Changes(NamedTuple):
    """Changed ``rectangles`` (n, 4) of the map: first row and column, last row and column. ``heights`` [m] without the
    map's z, and ``velocities`` [m/s] (N,): of one rectangle after the other, each row by row."""

    rectangles: IntArray
    heights: Floats
    velocities: Floats


@compiled
def update_soil(
    grid: MovingGrid, layer: SoilLayer, feet: Any, press: Press, flow: Flow, dirty: IntArray
) -> tuple[int, int]:
    """Press all ``feet``, records of ``FOOT``, into the soil, and return the numbers of rectangles and of samples of
    the map that change; ``dirty``: see `no_blocks`."""
    press_all(grid, layer, feet, press)
    finish_all(grid, layer, feet, press, flow, dirty)
    count, size = 0, 0
    for a in range(dirty.shape[0]):
        for b in range(dirty.shape[1]):
            if dirty[a, b, 2] >= 0:
                count += 1
                size += (dirty[a, b, 2] - dirty[a, b, 0] + 1) * (dirty[a, b, 3] - dirty[a, b, 1] + 1)
    return count, size


@compiled
def list_changes(
    grid: MovingGrid, layer: SoilLayer, press: Press, flow: Flow, dirty: IntArray, changes: Changes
) -> None:
    """Fill ``changes`` with what `update_soil` changed. It does not return new arrays in a named tuple, because Numba
    0.68 crashes when a signal interrupts it while it makes one."""
    count, size = 0, 0
    for a in range(dirty.shape[0]):
        for b in range(dirty.shape[1]):
            if dirty[a, b, 2] >= 0:
                for k in range(4):
                    changes.rectangles[count, k] = dirty[a, b, k]
                count += 1
                for r in range(dirty[a, b, 0], dirty[a, b, 2] + 1):
                    for c in range(dirty[a, b, 1], dirty[a, b, 3] + 1):
                        changes.heights[size], changes.velocities[size] = change_at(grid, layer, r, c, press, flow)
                        size += 1


@compiled
def finish_all(grid: MovingGrid, layer: SoilLayer, feet: Any, press: Press, flow: Flow, dirty: IntArray) -> None:
    """Complete an update after `press_all`, and note in ``dirty`` (block rows, block columns, 4) the first row and
    column, last row and column of the samples of each block whose height changes."""
    dirty[:, :, :2] = NOWHERE
    dirty[:, :, 2:] = -1
    for k in range(len(feet)):
        recover(layer, feet[k], press.number)
    margin = (flow.rim if flow.share > 0.0 else 0) + flow.slides
    for k in range(len(feet)):
        foot = feet[k]
        if flow.share > 0.0 and foot.displaced > 0.0:
            move_to_rim(grid, layer, foot, press.number, flow)
        if flow.slides > 0:
            slide_down(grid, layer, grown(foot.first, foot.last, margin, layer), press.number, flow)
    for k in range(len(feet)):
        foot = feet[k]
        top, left, bottom, right = grown(foot.first, foot.last, margin, layer)
        changed = note_changes(
            grid, layer, min(top, foot.seen_first[0]), min(left, foot.seen_first[1]), max(bottom, foot.seen_last[0]),
            max(right, foot.seen_last[1]), press, flow, dirty,
        )  # fmt: skip
        foot.seen_first[0], foot.seen_first[1] = min(top, changed[0]), min(left, changed[1])
        foot.seen_last[0], foot.seen_last[1] = max(bottom, changed[2]), max(right, changed[3])


@compiled
def grown(first: IntArray, last: IntArray, margin: int, layer: SoilLayer) -> tuple[int, int, int, int]:
    """Return a rectangle of samples with a margin: first row and column, last row and column."""
    rows, columns = layer.level.shape
    if last[0] < first[0]:
        return NOWHERE, NOWHERE, -1, -1
    return (
        max(first[0] - margin, 0), max(first[1] - margin, 0), min(last[0] + margin, rows - 1),
        min(last[1] + margin, columns - 1),
    )  # fmt: skip


@compiled
def recover(layer: SoilLayer, foot: Any, number: int) -> None:
    """Unload the samples that the body has left: they recover their elastic sinkage."""
    for r in range(foot.seen_first[0], foot.seen_last[0] + 1):
        for c in range(foot.seen_first[1], foot.seen_last[1] + 1):
            if layer.touched[r, c] == 1 and layer.pressed[r, c] != number and layer.pressure[r, c] > 0.0:
                layer.pressure[r, c] = layer.shear_x[r, c] = layer.shear_y[r, c] = 0.0
                layer.target[r, c] = layer.level[r, c] - layer.plastic[r, c]


@compiled
def raise_level(layer: SoilLayer, r: int, c: int, by: float) -> None:
    """Add loose soil to a sample without load, or take it away [m]."""
    layer.level[r, c] += by
    layer.target[r, c] = layer.level[r, c] - layer.plastic[r, c]


@compiled
def move_to_rim(grid: MovingGrid, layer: SoilLayer, foot: Any, number: int, flow: Flow) -> None:
    """Distribute the displaced volume over the samples around the body that were never pressed; if there are none, over
    all without load."""
    top, left, bottom, right = grown(foot.first, foot.last, flow.rim, layer)
    for pristine in (True, False):
        count = 0
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                count += takes_soil(grid, layer, r, c, number, pristine)
        if count > 0:
            by = flow.share * foot.displaced / (count * grid.resolution * grid.resolution)
            for r in range(top, bottom + 1):
                for c in range(left, right + 1):
                    if takes_soil(grid, layer, r, c, number, pristine):
                        raise_level(layer, r, c, by)
            return


@compiled
def takes_soil(grid: MovingGrid, layer: SoilLayer, r: int, c: int, number: int, pristine: bool) -> bool:
    """Return True if displaced soil may move onto a sample."""
    if math.isnan(grid.heights[r, c]) or layer.pressed[r, c] == number:
        return False
    note_ground(grid, layer, r, c)
    return not pristine or layer.plastic[r, c] == 0.0


@compiled
def slide_down(
    grid: MovingGrid, layer: SoilLayer, rectangle: tuple[int, int, int, int], number: int, flow: Flow
) -> None:
    """Move soil between neighbouring samples without load that are steeper than the angle of repose, at least one of
    which was touched."""
    top, left, bottom, right = rectangle
    for _ in range(flow.slides):
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                if c < right:
                    even_out(grid, layer, r, c, r, c + 1, number, flow.drop)
                if r < bottom:
                    even_out(grid, layer, r, c, r + 1, c, number, flow.drop)


@compiled
def even_out(grid: MovingGrid, layer: SoilLayer, r: int, c: int, s: int, d: int, number: int, drop: float) -> None:
    """Move soil from the higher of the samples (r, c) and (s, d) to the lower one until they differ by ``drop`` [m]."""
    if layer.touched[r, c] == 0 and layer.touched[s, d] == 0:
        return
    if layer.pressed[r, c] == number or layer.pressed[s, d] == number:
        return
    if math.isnan(grid.heights[r, c]) or math.isnan(grid.heights[s, d]):
        return
    note_ground(grid, layer, r, c)
    note_ground(grid, layer, s, d)
    difference = layer.target[r, c] - layer.target[s, d]
    excess = abs(difference) - drop
    if excess > 0.0:
        by = 0.5 * excess if difference > 0.0 else -0.5 * excess
        raise_level(layer, r, c, -by)
        raise_level(layer, s, d, by)


@compiled
def note_changes(
    grid: MovingGrid, layer: SoilLayer, top: int, left: int, bottom: int, right: int, press: Press, flow: Flow,
    dirty: IntArray,
) -> tuple[int, int, int, int]:  # fmt: skip
    """Note the samples of a rectangle whose height changes, or which have to stop, in the ``dirty`` blocks; return the
    rectangle around them."""
    first_r, first_c, last_r, last_c = NOWHERE, NOWHERE, -1, -1
    for r in range(top, bottom + 1):
        for c in range(left, right + 1):
            if layer.touched[r, c] == 0 or layer.known[r, c] != grid.heights[r, c]:
                continue
            now = sample_at(grid, r, c, press.time, 0.0)[0] - grid.z
            if layer.moves[r, c] == 1 or abs(layer.target[r, c] - now) > flow.still:
                a, b = r >> BLOCK_SHIFT, c >> BLOCK_SHIFT
                dirty[a, b, 0], dirty[a, b, 1] = min(dirty[a, b, 0], r), min(dirty[a, b, 1], c)
                dirty[a, b, 2], dirty[a, b, 3] = max(dirty[a, b, 2], r), max(dirty[a, b, 3], c)
                first_r, first_c, last_r, last_c = min(first_r, r), min(first_c, c), max(last_r, r), max(last_c, c)
    return first_r, first_c, last_r, last_c


@inlined
def change_at(grid: MovingGrid, layer: SoilLayer, r: int, c: int, press: Press, flow: Flow) -> tuple[float, float]:
    """Return the new height [m] and speed [m/s] of a sample, and note them: it starts where it is and reaches its
    target at the end of the update."""
    height, speed = grid.heights[r, c], 0.0
    if layer.touched[r, c] == 0 or layer.known[r, c] != height:
        return height, speed
    now = sample_at(grid, r, c, press.time, 0.0)[0] - grid.z
    left = min(layer.target[r, c] - now, flow.farthest)
    if layer.pressed[r, c] != press.number:
        left = max(left, -flow.farthest)
    if flow.still < abs(left) <= flow.carried:
        height, speed = np.float32(now), left / press.dt
        layer.moves[r, c] = 1
    elif abs(left) > flow.still or layer.moves[r, c] == 1:
        height = np.float32(now + left)
        layer.moves[r, c] = 0
    layer.known[r, c] = height
    return height, speed


def no_blocks(shape: tuple[int, int]) -> IntArray:
    """Return the table ``dirty`` of `finish_all` for a map of (rows, columns) samples."""
    rows, columns = (-(-size // (1 << BLOCK_SHIFT)) for size in shape)
    return np.empty((rows, columns, 4), np.int64)
