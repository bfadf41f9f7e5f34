"""Rigid motion of a grid from map to map.

A map that travels with a robot moves by whole cells, so that its samples keep their positions (as in grid_map and
costmaps). A grid that moved by a fraction of a cell, or rotated, moved together with the ground. Its velocity is
measured from the last pose at which motion was detected, not from the last map, because slow motion between two maps
is smaller than the rounding of poses.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.motion import INTERVALS_KEPT

# Displacement of a corner that counts as motion, and tolerance for moves by a whole number of cells [cells].
OFF_GRID = 0.01
# A moving grid has stopped if its corners should have moved by this distance, but it did not move [cells].
OVERDUE = 0.03
# Tolerance of the predicted position [cells]. If a moving grid moves by a whole number of cells within this tolerance,
# its motion continues; otherwise the map was scrolled.
AS_EXPECTED = 0.1

Cells = tuple[int, int]


class RigidMotion(NamedTuple):
    """Horizontal velocity (``x``, ``y``) [m/s] of a grid's sample (0, 0), and the grid's ``spin`` about z [rad/s]."""

    x: float = 0.0
    y: float = 0.0
    spin: float = 0.0


STILL = RigidMotion()


class GridTrack(NamedTuple):
    """Pose of a grid at its last whole map, and its motion.

    ``geometry``, ``time`` [s]: of the last map. ``reference``, ``since`` [s]: pose and time at which motion was last
    detected; the next motion is measured from there. ``motion``: at the last map. ``intervals`` [s]: between the last
    maps, newest first, none at rest.
    """

    geometry: GridGeometry
    time: float
    reference: GridGeometry
    since: float
    motion: RigidMotion = STILL
    intervals: tuple[float, ...] = ()

    @property
    def interval(self) -> float:
        """Longest expected time until the next map [s], as of blocks of samples; zero at rest."""
        return max(self.intervals, default=0.0)

    @property
    def moves(self) -> bool:
        """True if the grid moves."""
        return self.motion != STILL


def at_rest(geometry: GridGeometry, time: float) -> GridTrack:
    """Return the track of a grid that does not move."""
    return GridTrack(geometry, time, geometry, time)


def moved_on(geometry: GridGeometry, motion: RigidMotion, duration: float) -> tuple[float, float, float]:
    """Return x and y [m] of a grid's sample (0, 0) and the grid's yaw [rad] after a ``duration`` [s].

    The sample moves on an arc, because its velocity is constant in the rotating frame of the grid.
    """
    turn = motion.spin * duration
    along, cos, sin = duration * _chord(turn), math.cos(0.5 * turn), math.sin(0.5 * turn)
    x, y, _ = geometry.origin
    return (
        x + along * (motion.x * cos - motion.y * sin), y + along * (motion.x * sin + motion.y * cos),
        geometry.yaw + turn,
    )  # fmt: skip


def motion_between(before: GridGeometry, after: GridGeometry, duration: float) -> RigidMotion:
    """Return the motion between two poses of a grid, ``duration`` [s] apart, at the end of it; see `moved_on`."""
    turn = math.remainder(after.yaw - before.yaw, math.tau)
    inverse, cos, sin = 1.0 / (duration * _chord(turn)), math.cos(0.5 * turn), math.sin(0.5 * turn)
    x, y = after.origin[0] - before.origin[0], after.origin[1] - before.origin[1]
    return RigidMotion((x * cos - y * sin) * inverse, (x * sin + y * cos) * inverse, turn / duration)


def cells_moved(before: GridGeometry, after: GridGeometry) -> Cells | None:
    """Return the (rows, columns) by which a grid moved; None for a different grid or one without common samples."""
    if after.origin[2] != before.origin[2] or not same_grid(before, after):
        return None
    cells = _whole_cells(_corner_moves(before, after.origin[0], after.origin[1], after.yaw))
    return cells if _overlap(before, cells) else None


def same_grid(before: GridGeometry, after: GridGeometry) -> bool:
    """Return True if two grids are equal except for their poses."""
    return replace(after, origin=before.origin, yaw=before.yaw) == before


def follow(
    track: GridTrack, geometry: GridGeometry, time: float, max_interval: float, max_velocity: float
) -> tuple[GridTrack, Cells | None]:
    """Return the track after another whole map, and the (rows, columns) by which the map was scrolled.

    Scrolling assigns samples of the new map to samples of the old one; None if that assignment is unknown. Maps more
    than ``max_interval`` [s] apart give no motion. A grid that moves faster than ``max_velocity`` [m/s] has jumped.
    """
    if geometry == track.geometry and not track.moves:
        return track._replace(time=time), (0, 0)
    rests = at_rest(geometry, time)
    if not same_grid(track.geometry, geometry):
        return rests, None
    place = (geometry.origin[0], geometry.origin[1], geometry.yaw)
    step, interval = _corner_moves(track.geometry, *place), time - track.time
    cells = _whole_cells(step)
    shared = cells if _overlap(geometry, cells) else None
    if interval == 0.0 and cells == (0, 0):
        return track._replace(geometry=geometry), cells
    if not 0.0 < interval <= max_interval:
        return rests, shared
    if cells != (0, 0) and cells is not None and not _goes_on(track, step, interval):
        return rests, shared
    intervals = (interval, *track.intervals)[:INTERVALS_KEPT]
    if _largest(_corner_moves(track.reference, *place)) <= OFF_GRID:
        expected = _corner_moves(track.reference, *moved_on(track.reference, track.motion, time - track.since))
        if track.moves and _largest(expected) > OVERDUE:
            return rests, (0, 0)
        return track._replace(geometry=geometry, time=time, intervals=intervals if track.moves else ()), (0, 0)
    arc = _largest(step) * geometry.resolution / _chord(math.remainder(geometry.yaw - track.geometry.yaw, math.tau))
    if arc > max_velocity * interval:
        return rests, None
    # A grid at rest starts to move after its last map.
    first, since = (track.reference, track.since) if track.moves else (track.geometry, track.time)
    return GridTrack(geometry, time, geometry, time, motion_between(first, geometry, time - since), intervals), (0, 0)


def _goes_on(track: GridTrack, step: tuple[float, ...], interval: float) -> bool:
    """Return True if the ``step`` [cells] of a moving grid agrees with its motion."""
    if not track.moves:
        return False
    expected = _corner_moves(track.geometry, *moved_on(track.geometry, track.motion, interval))
    return _largest(tuple(a - b for a, b in zip(step, expected, strict=True))) <= AS_EXPECTED


def _whole_cells(moves: tuple[float, ...]) -> Cells | None:
    """Return a move as whole cells (rows, columns), None if it is not a whole number of cells."""
    rows, columns = round(moves[0]), round(moves[1])
    if _largest(tuple(move - whole for move, whole in zip(moves, 2 * (rows, columns), strict=True))) > OFF_GRID:
        return None
    return rows, columns


def _overlap(geometry: GridGeometry, cells: Cells | None) -> bool:
    """Return True if a grid overlaps with itself moved by so many cells; False for None."""
    return cells is not None and abs(cells[0]) < geometry.rows and abs(cells[1]) < geometry.columns


def _corner_moves(before: GridGeometry, x: float, y: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the displacements (row, column) of a grid's first and last sample [cells of the grid ``before``].

    ``x``, ``y`` [m]: new position of the first sample. ``yaw`` [rad]: new yaw.
    """
    cos, sin = math.cos(before.yaw) / before.resolution, math.sin(before.yaw) / before.resolution
    dx, dy = x - before.origin[0], y - before.origin[1]
    row, column = dy * cos - dx * sin, dx * cos + dy * sin
    turn = yaw - before.yaw
    less, sine = -2.0 * math.sin(0.5 * turn) ** 2, math.sin(turn)  # less: cosine minus one
    last_row, last_column = before.rows - 1, before.columns - 1
    return (
        row, column, row + last_row * less + last_column * sine, column + last_column * less - last_row * sine,
    )  # fmt: skip


def _largest(values: tuple[float, ...]) -> float:
    return max(map(abs, values))


def _chord(turn: float) -> float:
    """Return the length of a chord divided by the length of its arc [-], for an arc of ``turn`` [rad]."""
    half = 0.5 * turn  # of the least number it is zero
    return math.sin(half) / half if half else 1.0
