"""When the parts of a map were updated, which tells how they move on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.motion import PATIENCE, REST, MotionMode, progress

# Side of the square blocks of samples that share an age [samples].
BLOCK = 64
# How far the blocks of a map are along is worked out for all of them at once where there are no more.
MOST_AT_ONCE = 4096

Blocks = tuple[slice, slice]


class Stream(NamedTuple):
    """How updates come: ``lifetime`` [s], the expected time from the last to the next of ground that moves, 0 = none is
    expected; ``steady_until`` [s], until when, from the last update on, all ground keeps its velocity in *extrapolate*.
    """

    lifetime: float
    steady_until: float


class BlockClocks:
    """The clocks of the blocks of a map of ``rows`` x ``columns`` samples."""

    def __init__(self, rows: int, columns: int) -> None:
        shape = (-(-rows // BLOCK), -(-columns // BLOCK))
        self._columns = columns
        self.all: Blocks = (slice(0, shape[0]), slice(0, shape[1]))
        self._time = np.full(shape, -np.inf)
        self._interval = np.full(shape, np.inf)  # velocity = (heights - before) / interval
        self._lifetime = np.zeros(shape)  # expected time to the next update; 0 = at rest
        self._version = np.zeros(shape, np.int64)  # of the map, when the block was updated
        self._alike = True  # whether all blocks have the same clock
        self.moves_until = -math.inf  # when the last of them comes to rest [s]
        self.latest = -math.inf  # time of the newest update [s]
        self._stream: Stream | None = None  # None = to be worked out
        self._progress_key: tuple[float, MotionMode] | None = None  # what the progress was worked out for
        self._progress_known = (math.inf, 0.0, 0.0)  # of all, where they are alike
        self._progress_of = np.empty((0, 3))  # of each block, row by row: interval [s], offset [s], rate

    @staticmethod
    def around(row: int, column: int, end_row: int, end_column: int) -> Blocks:
        """The blocks that hold samples of a rectangle."""
        return (
            slice(row // BLOCK, (end_row - 1) // BLOCK + 1),
            slice(column // BLOCK, (end_column - 1) // BLOCK + 1),
        )

    @staticmethod
    def samples(blocks: Blocks) -> tuple[slice, slice]:
        """The samples in blocks."""
        rows, columns = blocks
        return slice(rows.start * BLOCK, rows.stop * BLOCK), slice(columns.start * BLOCK, columns.stop * BLOCK)

    def before(self, time: float, blocks: Blocks) -> list[Blocks]:
        """Those of ``blocks`` that were updated before ``time`` [s]: all at once if that are all, else one by one."""
        older = self._time[blocks] < time
        if older.all():
            return [blocks]
        found = np.argwhere(older) + (blocks[0].start, blocks[1].start)
        return [(slice(row, row + 1), slice(column, column + 1)) for row, column in found.tolist()]

    def update(self, blocks: Blocks, time: float, version: int, max_interval: float, *, given: bool) -> None:
        """Notes that ``blocks`` were updated at ``time`` [s] with ``version`` of the map, and over which interval their
        velocity is to be worked out.

        A given velocity is kept as the heights one second before. An estimated one needs an update before that is no
        further back than ``max_interval`` [s]; the same instant sent again is a correction, and the velocity stands.
        """
        since = time - self._time[blocks]
        recent = (since > 0.0) & (since <= max_interval)
        lifetime = np.where(recent, since, max_interval if given else 0.0)
        interval = np.full_like(since, 1.0) if given else np.where(recent, since, np.inf)
        if not given:
            corrected = since == 0.0
            lifetime = np.where(corrected, self._lifetime[blocks], lifetime)
            interval = np.where(corrected, self._interval[blocks], interval)
        self._lifetime[blocks], self._interval[blocks], self._time[blocks] = lifetime, interval, time
        self._version[blocks] = version
        self._alike = lifetime.size == self._time.size and (lifetime.size == 1 or bool(np.ptp(lifetime) == 0.0))
        self.moves_until = max(self.moves_until, time + REST * float(lifetime.max()))
        self.latest = time if time >= self.latest else float(self._time.max())
        self._stream = self._progress_key = None

    def shift(self, by: float) -> None:
        """Moves all times by so many seconds."""
        self._time += by
        self.moves_until += by
        self.latest += by
        self._stream = self._progress_key = None

    @property
    def stream(self) -> Stream:
        """How updates come."""
        if self._stream is None:
            moves = self._time + REST * self._lifetime > self.latest
            lifetime, fresh_until = self._lifetime[moves], self._time[moves] + PATIENCE * self._lifetime[moves]
            self._stream = Stream(float(lifetime.max(initial=0.0)), float(fresh_until.min(initial=math.inf)))
        return self._stream

    def of(self, rows: IntArray, columns: IntArray) -> tuple[FloatArray, FloatArray]:
        """When samples (n,) were last updated (n,) [s], and how soon that is expected again (n,) [s], 0 = not at all;
        beyond the edge those at the edge."""
        block = self._block_rows(rows), self._block_columns(columns)
        return self._time[block], self._lifetime[block]

    def changed(self, rows: IntArray, columns: IntArray, reach: IntArray, version: IntArray) -> BoolArray:
        """Whether samples may have changed (n,), within ``reach`` (n,) samples of ``rows``, ``columns`` (n,), since a
        ``version`` (n,) of the map."""
        if self._alike:
            return np.asarray(version < self._version[0, 0])
        found = reach > BLOCK  # such a patch may lie on further blocks
        # A patch of half that lies on no other blocks than those of its corners.
        places = (-reach, reach) if (2 * reach <= BLOCK).all() else (-reach, 0, reach)
        for down in places:
            row = self._block_rows(rows + down)
            for aside in places:
                found |= version < self._version[row, self._block_columns(columns + aside)]
        return np.asarray(found)

    def progress(self, mode: MotionMode, centres: IntArray, time: float) -> tuple[Any, Any, Any]:
        """What velocities are divided by [s], and how far along them the ground is at ``time`` [s] (offset [s], rate);
        each one number for all of ``centres`` (n,) or an array (n, 1)."""
        # Asked for several times a step.
        key = (time, mode)
        fresh, self._progress_key = self._progress_key != key, key
        if self._alike:
            if fresh:
                offset, rate = progress(mode, time - self._time[0, :1], self._lifetime[0, :1])
                self._progress_known = float(self._interval[0, 0]), float(offset[0]), float(rate[0])
            return self._progress_known
        rows, columns = np.divmod(centres, self._columns)
        block = rows // BLOCK * self._time.shape[1] + columns // BLOCK
        if self._time.size > MOST_AT_ONCE:
            time_of, lifetime = self._time.ravel()[block], self._lifetime.ravel()[block]
            offset, rate = progress(mode, time - time_of, lifetime)
            return self._interval.ravel()[block, None], offset[:, None], rate[:, None]
        if fresh:
            offset, rate = progress(mode, time - self._time, self._lifetime)
            self._progress_of = np.stack([self._interval, offset, rate], axis=-1).reshape(-1, 3)
        known = self._progress_of.take(block, axis=0)
        return known[:, :1], known[:, 1:2], known[:, 2:]

    def _block_rows(self, rows: IntArray) -> IntArray:
        return np.minimum(np.maximum(rows // BLOCK, 0), self._time.shape[0] - 1)

    def _block_columns(self, columns: IntArray) -> IntArray:
        return np.minimum(np.maximum(columns // BLOCK, 0), self._time.shape[1] - 1)
