"""Which bodies are still, and which sleeping bodies the others reach."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.physics.neighbours import mark_near
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# Columns of the table of anchors (S, 8): position [m] and orientation (x, y, z, w) that a still body stays near, and
# the time since when [s].
SINCE = 7


@compiled
def note_motion(
    chosen: IntArray, states: FloatArray, shapes: Any, anchors: FloatArray, time: float, distance: float
) -> None:
    """Move the anchors (S, 8) of the bodies in the slots ``chosen`` (n,) that moved farther than ``distance`` [m] from
    theirs. ``states`` (S, 13)."""
    for k in range(len(chosen)):
        i = chosen[k]
        if not strayed(states[i], anchors[i], shapes.table[i].radius) <= distance:
            anchors[i, :7] = states[i, :7]
            anchors[i, SINCE] = time


@compiled
def strayed(state: FloatArray, anchor: FloatArray, radius: float) -> float:
    """Bound on the distance [m] of any point of a body (13,) with a bounding ``radius`` [m] from its place at the
    anchor (8,); NaN if there is none."""
    square, cosine = 0.0, 0.0
    for axis in range(3):
        square += (state[axis] - anchor[axis]) ** 2
    for axis in range(3, 7):
        cosine += state[axis] * anchor[axis]
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))  # of half the angle between the two orientations
    return math.sqrt(square) + 2.0 * sine * radius


@compiled
def mark_reached(
    movers: IntArray, states: FloatArray, positions: FloatArray, moved: FloatArray, anchors: FloatArray,
    radii: FloatArray, boxes: FloatArray, elapsed: float, config: tuple[float, float, float, float, float],
    order: IntArray, widest: float, found: BoolArray,
) -> bool:  # fmt: skip
    """Mark in ``found`` (S,) the sleeping bodies that the bodies in the slots ``movers`` (n,) may touch in the coming
    step; returns True if there are any.

    ``states`` (S, 13), ``boxes`` (S, 6): at the last update, ``elapsed`` [s] ago; ``positions``, ``moved`` (S, 3) [m]:
    now, and in the coming step. ``config``: time now, `SleepConfig.after`, ``distance``, ``near``, ``near_share``.
    ``order``, ``widest``: as in `mark_near`. Bodies that are still do not count.
    """
    time, after, distance, near, near_share = config
    any_found = False
    box = np.empty(6)
    for k in range(len(movers)):
        i = movers[k]
        away = step = spin = 0.0
        for axis in range(3):
            away += (positions[i, axis] - anchors[i, axis]) ** 2
            step += moved[i, axis] ** 2
            spin += states[i, 10 + axis] ** 2
        if time - anchors[i, SINCE] >= after and away <= distance * distance and step <= distance * distance:
            continue
        turned = min(math.sqrt(spin) * elapsed, 2.0) * radii[i]
        for axis in range(3):
            went = positions[i, axis] - states[i, axis]
            box[axis] = boxes[i, axis] + went - turned
            box[axis + 3] = boxes[i, axis + 3] + went + turned
        reach = near + math.sqrt(step)
        if mark_near(box, reach, radii[i], order, widest, boxes, radii, near_share, found):
            any_found = True
    return any_found
