"""Where a grid lies from map to map, and how it moves as one piece.

A map that travels with a robot is moved by whole cells, so that its samples stay where they were (as grid_map and
costmaps do). The same grid in any other place, or turned, has moved there with the ground. The motion is measured from
where the grid was last seen to have moved, not from the last map: from map to map a slow one is no more than rounding.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from smartmesh_ros.terrain.grid import GridGeometry

# A grid has moved once a corner is further than this from where it was [cells]; moves that are no further from a whole
# number of cells are by whole cells.
OFF_GRID = 0.01
# A moving grid has come to rest once a corner should have moved by this and the grid has not [cells].
OVERDUE = 0.03
# A moving grid that comes a whole number of cells further on goes on moving if that is within this of where it was to
# come [cells].
AS_EXPECTED = 0.1

Cells = tuple[int, int]


class RigidMotion(NamedTuple):
    """Horizontal velocity (``x``, ``y``) [m/s] of a grid's sample (0, 0), and the grid's ``spin`` about z [rad/s]."""

    x: float = 0.0
    y: float = 0.0
    spin: float = 0.0


STILL = RigidMotion()


class GridTrack(NamedTuple):
    """Where a grid lay at its last whole map, and how it moves since.

    ``geometry``, ``time`` [s]: of the last map. ``reference``, ``since`` [s]: where and when it was last seen to have
    moved; the motion is measured from there. ``motion``: as of the last map. ``interval`` [s]: between the last two
    maps, zero at rest.
    """

    geometry: GridGeometry
    time: float
    reference: GridGeometry
    since: float
    motion: RigidMotion = STILL
    interval: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether the grid moves."""
        return self.motion != STILL

    def shifted(self, by: float) -> GridTrack:
        """The same with all times ``by`` [s] later."""
        return self._replace(time=self.time + by, since=self.since + by)


def at_rest(geometry: GridGeometry, time: float) -> GridTrack:
    """The track of a grid that does not move."""
    return GridTrack(geometry, time, geometry, time)


def moved_on(geometry: GridGeometry, motion: RigidMotion, duration: float) -> tuple[float, float, float]:
    """Where sample (0, 0) of a grid is after a ``duration`` [s], x and y [m], and its yaw [rad]. Who turns along with
    the grid sees a steady velocity: an arc."""
    turn = motion.spin * duration
    along, cos, sin = duration * _chord(turn), math.cos(0.5 * turn), math.sin(0.5 * turn)
    x, y, _ = geometry.origin
    return (
        x + along * (motion.x * cos - motion.y * sin), y + along * (motion.x * sin + motion.y * cos),
        geometry.yaw + turn,
    )  # fmt: skip


def motion_between(before: GridGeometry, after: GridGeometry, duration: float) -> RigidMotion:
    """The motion, as of its end, that takes a grid from one place to another in a ``duration`` [s]; see `moved_on`."""
    turn = math.remainder(after.yaw - before.yaw, math.tau)
    inverse, cos, sin = 1.0 / (duration * _chord(turn)), math.cos(0.5 * turn), math.sin(0.5 * turn)
    x, y = after.origin[0] - before.origin[0], after.origin[1] - before.origin[1]
    return RigidMotion((x * cos - y * sin) * inverse, (x * sin + y * cos) * inverse, turn / duration)


def velocity_after(motion: RigidMotion, duration: float) -> tuple[float, float]:
    """Velocity of sample (0, 0) after a ``duration`` [s] of a motion [m/s]."""
    cos, sin = math.cos(motion.spin * duration), math.sin(motion.spin * duration)
    return motion.x * cos - motion.y * sin, motion.x * sin + motion.y * cos


def cells_moved(before: GridGeometry, after: GridGeometry) -> Cells | None:
    """(rows, columns) by which a grid was moved; None if it is another grid, or no sample is on both."""
    if after.origin[2] != before.origin[2] or not same_grid(before, after):
        return None
    cells = _whole_cells(_corner_moves(before, after.origin[0], after.origin[1], after.yaw))
    return cells if _overlap(before, cells) else None


def same_grid(before: GridGeometry, after: GridGeometry) -> bool:
    """Whether two grids are equal but for where they lie."""
    return replace(after, origin=before.origin, yaw=before.yaw) == before


def follow(
    track: GridTrack, geometry: GridGeometry, time: float, max_interval: float, max_velocity: float
) -> tuple[GridTrack, Cells | None]:
    """The track after a further whole map, and which samples of the map before are the new one's: they lie so many
    cells further (rows, columns); None where no sample is known to be the same.

    Maps further apart than ``max_interval`` [s] tell no motion, and what moves faster than ``max_velocity`` [m/s] has
    jumped.
    """
    rests = at_rest(geometry, time)
    if geometry == track.geometry and not track.moves:
        return track._replace(time=time), (0, 0)
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
    if _largest(_corner_moves(track.reference, *place)) <= OFF_GRID:
        expected = _corner_moves(track.reference, *moved_on(track.reference, track.motion, time - track.since))
        if track.moves and _largest(expected) > OVERDUE:
            return rests, (0, 0)
        return track._replace(geometry=geometry, time=time, interval=interval if track.moves else 0.0), (0, 0)
    arc = _largest(step) * geometry.resolution / _chord(math.remainder(geometry.yaw - track.geometry.yaw, math.tau))
    if arc > max_velocity * interval:
        return rests, None
    # What was at rest begins to move with this map: until the last one it stood.
    first, since = (track.reference, track.since) if track.moves else (track.geometry, track.time)
    return GridTrack(geometry, time, geometry, time, motion_between(first, geometry, time - since), interval), (0, 0)


def _goes_on(track: GridTrack, step: tuple[float, ...], interval: float) -> bool:
    """Whether a moving grid made a ``step`` as its motion lets expect."""
    if not track.moves:
        return False
    expected = _corner_moves(track.geometry, *moved_on(track.geometry, track.motion, interval))
    return _largest(tuple(a - b for a, b in zip(step, expected, strict=True))) <= AS_EXPECTED


def _whole_cells(moves: tuple[float, ...]) -> Cells | None:
    """The whole cells (rows, columns) of a move; None if it is not by whole cells."""
    rows, columns = round(moves[0]), round(moves[1])
    if _largest(tuple(move - whole for move, whole in zip(moves, 2 * (rows, columns), strict=True))) > OFF_GRID:
        return None
    return rows, columns


def _overlap(geometry: GridGeometry, cells: Cells | None) -> bool:
    """Whether a grid has samples in common with itself moved by so many cells."""
    return cells is not None and abs(cells[0]) < geometry.rows and abs(cells[1]) < geometry.columns


def _corner_moves(before: GridGeometry, x: float, y: float, yaw: float) -> tuple[float, float, float, float]:
    """How far a grid's first sample, now at ``x``, ``y`` [m], and its last one lie from where they were, along rows and
    columns of the grid ``before`` [cells]."""
    cos, sin = math.cos(before.yaw) / before.resolution, math.sin(before.yaw) / before.resolution
    dx, dy = x - before.origin[0], y - before.origin[1]
    row, column = dy * cos - dx * sin, dx * cos + dy * sin
    turn = yaw - before.yaw
    less, sine = -2.0 * math.sin(0.5 * turn) ** 2, math.sin(turn)  # of the turn's cosine, what it is short of one
    last_row, last_column = before.rows - 1, before.columns - 1
    return (
        row, column, row + last_row * less + last_column * sine, column + last_column * less - last_row * sine,
    )  # fmt: skip


def _largest(values: tuple[float, ...]) -> float:
    return max(map(abs, values))


def _chord(turn: float) -> float:
    """Length of the chord of an arc of so much turn, as a share of the arc's [-]."""
    return math.sin(0.5 * turn) / (0.5 * turn) if turn else 1.0
