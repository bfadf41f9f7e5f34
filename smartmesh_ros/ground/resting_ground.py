"""The ground under sleeping bodies: detects changes since they fell asleep."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.patches.supports import with_rows
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.surface_query import ground_samples
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# Points on each side of the lattice under a body on a general mesh.
LATTICE = 5
NOTHING_FOUND: tuple[IntArray, FloatArray] = np.empty(0, np.int64), np.empty(0)


class RestingGround:
    """Heights and friction of the ground under sleeping bodies, as they were when the bodies fell asleep. Bodies are
    addressed by slot."""

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        # Of points under all bodies: x, y, the height of what is above, that of the ground [m], and its friction.
        self._ground: FloatArray = np.empty((0, 5))
        # By slot: first and last + 1 of the points under a body, and number of updates of the blocks under it.
        self._first: IntArray = np.empty(0, np.int64)
        self._end: IntArray = np.empty(0, np.int64)
        self._seen: IntArray = np.empty(0, np.int64)
        self._layout = -1
        self._revision = -1
        self._moving = False  # at the last check; one more check follows, of where the ground came to rest
        # By slot: mean change of the ground under a body since it fell asleep, and the part that moved the body [m].
        self._corrected: FloatArray = np.empty(0)
        self._moved: FloatArray = np.empty(0)
        self._found = NOTHING_FOUND  # slots and mean changes of a check, until they are kept

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self._first, self._end = with_rows(self._first, slots, 0), with_rows(self._end, slots, 0)
        self._seen = with_rows(self._seen, slots, -1)
        self._corrected, self._moved = with_rows(self._corrected, slots, 0.0), with_rows(self._moved, slots, 0.0)

    def forget(self, slots: IntArray) -> None:
        """Discard the heights under bodies that woke or went."""
        self._end[slots] = self._first[slots]
        kept = np.flatnonzero(self._end > self._first)
        if 2 * (self._end - self._first)[kept].sum() < len(self._ground):  # half of the memory is unused
            places, firsts = self._places(kept)
            self._ground = self._ground[places]
            self._first[kept], self._end[kept] = firsts[:-1], firsts[1:]

    def calm(self, chosen: IntArray, boxes: FloatArray, time: float, duration: float, limit: float) -> BoolArray:
        """Return which bodies (n,) have ground under them that moves by at most ``limit`` [m] in the ``duration`` [s]
        from ``time`` [s] on, and note the ground under all. ``boxes`` (S, 6)."""
        parts = [self._points_under(mesh, chosen, boxes, time) for mesh in self._terrain.tiles.values()]
        owner = np.concatenate([np.repeat(np.arange(len(chosen)), counts) for _, counts in parts] or [chosen[:0]])
        order = np.argsort(owner, kind="stable")
        points = np.concatenate([points for points, _ in parts] or [np.empty((0, 3))])[order]
        firsts = np.searchsorted(owner[order], np.arange(len(chosen) + 1))
        heights, velocities = self._ground_at(points, time)
        self._first[chosen] = len(self._ground) + firsts[:-1]
        self._end[chosen] = len(self._ground) + firsts[1:]
        found = np.column_stack([points, heights, self._terrain.friction_at(points[:, :2])])
        self._ground = np.concatenate([self._ground, found])
        self._seen[chosen], self._corrected[chosen], self._moved[chosen] = -1, 0.0, 0.0
        moves = np.abs(velocities) * duration > limit
        return ~_any_of(moves, firsts) & ~self._slides(chosen, boxes, time)

    def changed(
        self, asleep: IntArray, boxes: FloatArray, time: float, duration: float, config: SleepConfig
    ) -> IntArray:
        """Return the slots of those sleeping bodies (n,) whose ground differs by more than `SleepConfig.ground`, or
        will within the ``duration`` [s] from ``time`` [s] on, or has another friction."""
        terrain = self._terrain
        moving = any(mesh.moving(time) for mesh in terrain.tiles.values())
        if not asleep.size or not (moving or self._moving or terrain.changed_since(self._revision)):
            return asleep[:0]
        self._moving = moving
        counts = self._counts(asleep, boxes, time)
        other_tiles = terrain.layout_revision != self._layout
        self._revision, self._layout = terrain.revision, terrain.layout_revision
        touched: IntArray = asleep[(counts < 0) | (counts != self._seen[asleep]) | other_tiles]
        self._seen[asleep] = counts
        if not touched.size:
            return touched
        places, firsts = self._places(touched)
        points, known, friction = np.split(self._ground[places], (3, 4), axis=1)
        known, friction = known.ravel(), friction.ravel()
        heights, velocities = self._ground_at(points, time)
        limits = np.maximum(config.ground, config.noise * terrain.deviations_at(points[:, :2]))
        same = np.abs(heights - known) + np.abs(velocities) * duration <= limits
        same |= np.isnan(heights) & np.isnan(known)
        same &= terrain.friction_at(points[:, :2]) == friction
        total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(heights - known))])
        self._found = touched, (total[firsts[1:]] - total[firsts[:-1]]) / np.maximum(np.diff(firsts), 1)
        differ: IntArray = touched[_any_of(~same, firsts) | self._slides(touched, boxes, time)]
        return differ

    def _ground_at(self, points: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
        """Return the heights [m] and vertical velocities [m/s] of the ground at points (K, 3) [m]."""
        under = np.isfinite(points[:, 2])
        heights, velocities = np.empty(len(points)), np.empty(len(points))
        heights[~under], velocities[~under] = self._terrain.at(points[~under, :2], time)
        found = ground_samples(self._terrain, points[under], time)
        heights[under], velocities[under] = found.z, np.nan_to_num(found.velocities[:, 2])
        return heights, velocities

    def corrections(self, slots: IntArray) -> FloatArray:
        """Return by how much the ground under sleeping bodies was corrected since they fell asleep, or since
        `note_moved`, on average (n,) [m], as of the last `keep_corrections`."""
        corrections: FloatArray = self._corrected[slots] - self._moved[slots]
        return corrections

    def note_moved(self, slots: IntArray) -> None:
        """Note that sleeping bodies were moved with their `corrections`."""
        self._moved[slots] = self._corrected[slots]

    def keep_corrections(self) -> None:
        """Note the corrections that the last check found. Bodies that this check woke move with its correction in the
        same update, so their sum ends before it."""
        (slots, means), self._found = self._found, NOTHING_FOUND
        if any(isinstance(mesh, HeightMap) and mesh.motion.corrects for mesh in self._terrain.tiles.values()):
            self._corrected[slots] = means

    def _places(self, slots: IntArray) -> tuple[IntArray, IntArray]:
        """Return the places of the points under bodies, one body after another, and where each body's begin (n + 1)."""
        counts = self._end[slots] - self._first[slots]
        firsts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return np.repeat(self._first[slots] - firsts[:-1], counts) + np.arange(firsts[-1]), firsts

    def _counts(self, chosen: IntArray, boxes: FloatArray, time: float) -> IntArray:
        """Return the number of updates under each body (n,), -1 where the ground may move."""
        counts = np.zeros(len(chosen), np.int64)
        for mesh in self._terrain.tiles.values():
            if isinstance(mesh, HeightMap):
                CORE.count_updates(mesh.core_reader, time, chosen, boxes, counts)
            else:
                counts[:] = -1 if mesh.moving(time) else counts + mesh.revision
        return counts

    def _slides(self, chosen: IntArray, boxes: FloatArray, time: float) -> BoolArray:
        """Return which bodies (n,) are above a map that moves horizontally."""
        counts = np.zeros(len(chosen), np.int64)
        for mesh in self._terrain.tiles.values():
            if isinstance(mesh, HeightMap) and CORE.slides(mesh.core_reader, time):
                CORE.count_updates(mesh.core_reader, time, chosen, boxes, counts)
        return counts < 0

    def _points_under(
        self, mesh: MainMesh, chosen: IntArray, boxes: FloatArray, time: float
    ) -> tuple[FloatArray, IntArray]:
        """Return points (k, 3) [m] of a tile under bodies, and how many belong to each body (n,). A point is x, y, and
        the height above which ground does not count: on a mesh the top of the body, on a map infinity."""
        counts = np.zeros(len(chosen), np.int64)
        if isinstance(mesh, HeightMap):
            points = CORE.samples_under(mesh.core_reader, time, chosen, boxes, counts)
            return np.column_stack([points, np.full(len(points), math.inf)]), counts
        share = np.linspace(0.0, 1.0, LATTICE)
        low, size = boxes[chosen, :2], boxes[chosen, 3:5] - boxes[chosen, :2]
        across, along = np.meshgrid(share, share)
        lattice = np.stack([across.ravel(), along.ravel()], axis=1)
        counts[:] = LATTICE * LATTICE
        places = (low[:, None] + size[:, None] * lattice).reshape(-1, 2)
        return np.column_stack([places, np.repeat(boxes[chosen, 5], LATTICE * LATTICE)]), counts


def _any_of(marks: BoolArray, firsts: IntArray) -> BoolArray:
    """Return for each group of ``marks`` (K,), which begin at ``firsts`` (n + 1,), whether any is True (n,)."""
    total = np.concatenate([[0], np.cumsum(marks)])
    found: BoolArray = total[firsts[1:]] > total[firsts[:-1]]
    return found
