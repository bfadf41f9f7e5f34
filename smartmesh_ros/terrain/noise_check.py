"""Whether whole maps look like those of a sensor or mapper, although they are taken for maps of ground that moves.

Ground that moves goes on: from one map to the next a sample keeps its direction, and the ground tilts smoothly from
sample to sample. Two things that maps of sensors and mappers do are no motion:

- *Noise*. Changes reverse from map to map, and those of neighbouring samples differ at random. Waves look so only where
  maps have fewer than ten instants a period and, at the same time, fewer than five samples a wavelength.
- *Jumps*. Most of the ground is at rest, is somewhere else in the next map, and is at rest again: a closed loop.

A lattice of some hundred samples is compared, which stays in its place of the world while a map travels over the ground
by whole cells, and moves with a map that slides.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.terrain.grid_track import cells_moved
from smartmesh_ros.terrain.heightmap import HeightMap

FloatGrid = NDArray[np.float32]
# Samples of a place of the lattice: its own and those on either side of it in its row.
STENCIL = 3
# Mean absolute difference of the changes of two samples whose noise has a standard deviation of one.
MEAN_DIFFERENCE = math.sqrt(8.0 / math.pi)


@dataclass(frozen=True, kw_only=True)
class NoiseCheckConfig:
    """What counts as noise, and what as a jump. Raising a field delays the warning unless it says otherwise.

    ``samples``: of the map on a side that are compared, at most; more cost more time and tell more of small features.
    ``least_change`` [m]: smaller changes are not counted; contacts of heavy bodies give way by as much.
    ``reversed``: share of changes that reverse the one before. White noise has two thirds, that of a mapper that drifts
    a quarter and more, ground told n times a period 2 / n.
    ``agreeing``: share of places where the ground tilts the same way on both sides of a sample up to which this is
    chance; raising it warns sooner. White noise has a third, smoothed noise a half, a wave told n times a wavelength
    1 - 2 / n along its way.
    ``share``: of samples that change from map to map; fewer are the ground under a wheel or tool. ``changes``: so many
    are needed, and so many ``maps``, to say anything, and that it is noise for ``lasting`` [s]. ``memory`` [s]: time in
    which counts fade by two thirds.
    ``least_jump`` [m]: smaller jumps throw nothing. ``acceleration`` [m/s^2]: what ground needs that goes from rest to
    rest within the time between two maps; up to this, half of gravity, it may be a lift or a platform.
    ``rest`` [s]: how long the ground stands still before and after a jump. ``still``: share of a jump's height that
    ground at rest changes from map to map at most; raising it warns sooner, in stronger noise.
    ``hold`` [s]: how long what was seen is told after it was seen last.
    """

    samples: int = 16
    least_change: float = 0.0005
    reversed: float = 0.2
    agreeing: float = 0.6
    share: float = 0.02
    changes: int = 50
    maps: int = 5
    lasting: float = 1.0
    memory: float = 2.0
    least_jump: float = 0.01
    acceleration: float = 5.0
    rest: float = 1.0
    still: float = 0.25
    hold: float = 30.0


class Seen(NamedTuple):
    """What maps of ground at rest showed: the standard deviation of their ``noise`` [m], and the largest ``jump`` [m];
    zero where there was none."""

    noise: float
    jump: float

    def __str__(self) -> str:
        noise = f"noise of {1e3 * self.noise:.1f} mm" if self.noise > 0.0 else ""
        jumps = f"jumps of still ground by up to {100.0 * self.jump:.1f} cm" if self.jump > 0.0 else ""
        return " and ".join(part for part in (noise, jumps) if part)


NOTHING = Seen(0.0, 0.0)


class Lattice(NamedTuple):
    """Samples that are compared, (n, m) places in a ring: place (i, j) holds row and column ``cells`` (n, m, 2) of the
    world's lattice, the last ``heights`` there (n, m, STENCIL) [m], NaN = not known, and the last change of each place,
    ``steps`` (n, m) [m], zero = none yet. ``stride``: samples of the map from place to place, along rows and
    columns."""

    cells: NDArray[np.int64]
    heights: FloatArray
    steps: FloatArray
    stride: tuple[int, int]


class Counts(NamedTuple):
    """Sums over places: ``known`` now and in the map before; ``changed`` twice, ``reversed`` of these; ``tilted``
    between the samples on both sides, ``agreeing`` ones of these, and the sum of how much to one side, ``tilt`` [m]."""

    known: float
    changed: float
    reversed: float
    tilted: float
    agreeing: float
    tilt: float


NO_COUNTS = Counts(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Change(NamedTuple):
    """By how much most of the ground changed to the map at a ``time`` [s], the median ``step`` [m], and the time since
    the map before, ``interval`` [s]."""

    time: float
    step: float
    interval: float


class NoiseCheck:
    """Looks at the whole maps of one tile, in the order of their time. ``seen``: what they show; see `Seen`."""

    def __init__(self, config: NoiseCheckConfig | None = None) -> None:
        self.config = config or NoiseCheckConfig()
        self.seen = NOTHING
        self._time = self._heard = -math.inf  # of the last map, and when it was seen that ground does not move so [s]
        self._geometry: GridGeometry | None = None
        self._lattice, self._first = _lattice((0, 0), self.config.samples), (0, 0)
        self._maps, self._counts = 0.0, NO_COUNTS  # how many maps count, and what was counted in them
        self._noisy_since = math.inf  # [s]
        self._changes: deque[Change] = deque()

    def take(self, heightmap: HeightMap) -> None:
        """Takes note of a whole map that a height map has taken. Noise that it was told of counts for nothing."""
        geometry, heights, time, motion = heightmap.geometry, heightmap.heights, heightmap.time, heightmap.motion
        interval = time - self._time
        if 0.0 <= interval < motion.min_interval:
            return  # the same map in parts
        if not self._follow(geometry, heights) or not 0.0 < interval <= motion.max_interval:
            self._restart(time)
        self._time = time
        sizes = np.empty(self._lattice.steps.size)
        height, least = float(geometry.origin[2]), self.config.least_change
        counts = compare(self._lattice, heights, height, *self._first, least, sizes)
        known = int(counts.known)
        if not known:
            return
        fading = math.exp(-interval / self.config.memory)
        self._maps = fading * self._maps + 1.0
        self._counts = Counts(*(fading * a + b for a, b in zip(self._counts, counts, strict=True)))
        self._changes.append(Change(time, float(np.median(sizes[:known])), interval))
        self._tell(self._noise(time) if heightmap.noise == 0.0 else 0.0, self._jump(), time)

    def _follow(self, geometry: GridGeometry, heights: FloatGrid) -> bool:
        """Moves the lattice to where a map lies; False where it is another grid, whose lattice is new."""
        before, self._geometry = self._geometry, geometry
        size = (geometry.rows, geometry.columns, geometry.resolution)
        if before is None or size != (before.rows, before.columns, before.resolution):
            self._lattice, self._first = _lattice(heights.shape, self.config.samples), (0, 0)
            return False
        moved = cells_moved(before, geometry)
        if moved is None or moved == (0, 0):
            return True  # the map stays, slides or turns: so do its samples
        least = self.config.least_change
        if not moved_as_one(self._lattice, heights, float(geometry.origin[2]), *self._first, least):
            self._first = (self._first[0] + moved[0], self._first[1] + moved[1])
        return True

    def _restart(self, time: float) -> None:
        """Forgets what maps before ``time`` [s] said, but not what was seen."""
        self._maps, self._counts = 0.0, NO_COUNTS
        self._noisy_since = math.inf
        self._changes.clear()
        self._heard = -math.inf if self.seen == NOTHING else time
        self._lattice.heights[...] = math.nan
        self._lattice.steps[...] = 0.0

    def _noise(self, time: float) -> float:
        """Standard deviation of the noise [m]; zero where the maps up to ``time`` [s] show none, or not for long."""
        counts, config = self._counts, self.config
        enough = self._maps >= config.maps and counts.tilted >= config.changes
        enough = enough and counts.changed >= max(config.changes, config.share * counts.known)
        reverses = counts.reversed >= config.reversed * counts.changed
        if not (enough and reverses and counts.agreeing <= config.agreeing * counts.tilted):
            self._noisy_since = math.inf
            return 0.0
        self._noisy_since = min(self._noisy_since, time)
        return counts.tilt / counts.tilted / MEAN_DIFFERENCE if time - self._noisy_since >= config.lasting else 0.0

    def _jump(self) -> float:
        """Height of a jump [m] with rest before and after; zero where there was none."""
        changes, config = self._changes, self.config
        now = changes[-1].time
        while changes[0].time < now - 4.0 * config.rest:
            changes.popleft()
        largest = max(changes, key=lambda change: change.step)
        step, interval = largest.step, largest.interval
        if step < max(config.least_jump, 0.25 * config.acceleration * interval**2):
            return 0.0
        before, after = largest.time - changes[0].time, now - largest.time
        rests = all(change.step <= config.still * step for change in changes if change is not largest)
        if before < config.rest or after < config.rest or not rests:
            return 0.0
        while changes.popleft() is not largest:
            pass  # told once
        return step

    def _tell(self, noise: float, jump: float, time: float) -> None:
        """Notes what was seen, and forgets it once it was not seen for long."""
        if noise > 0.0 or jump > 0.0:
            self._heard = time
            self.seen = Seen(noise or self.seen.noise, max(jump, self.seen.jump))
        elif time - self._heard > self.config.hold:
            self.seen = NOTHING


def _lattice(shape: tuple[int, ...], samples: int) -> Lattice:
    """A lattice for maps of so many rows and columns, which knows nothing yet."""
    rows, columns = (max(-(-size // samples), 1) for size in shape)
    places = (-(-shape[0] // rows) + 1, -(-shape[1] // columns) + 1)  # one more where the map lies between them
    return Lattice(
        np.zeros((*places, 2), np.int64), np.full((*places, STENCIL), math.nan), np.zeros(places), (rows, columns)
    )


@compiled
def height_at(heights: FloatGrid, z: float, row: int, column: int) -> float:
    """Height of a sample [m]; NaN beyond the edge."""
    rows, columns = heights.shape
    return z + float(heights[row, column]) if 0 <= row < rows and 0 <= column < columns else math.nan


@compiled
def moved_as_one(
    lattice: Lattice, heights: FloatGrid, z: float, first_row: int, first_column: int, least: float
) -> bool:
    """Whether all samples of a map rose by the same, within ``least`` [m], above those of the same indices in the map
    before: the ground was carried with the map."""
    known, rise = 0, 0.0
    for i in range(lattice.cells.shape[0]):
        for j in range(lattice.cells.shape[1]):
            row = lattice.cells[i, j, 0] * lattice.stride[0] - first_row
            column = lattice.cells[i, j, 1] * lattice.stride[1] - first_column
            change = height_at(heights, z, row, column) - lattice.heights[i, j, 1]
            if math.isnan(change):
                continue
            if known == 0:
                rise = change
            if abs(change - rise) > least:
                return False
            known += 1
    return known > 0


@compiled
def compare(
    lattice: Lattice, heights: FloatGrid, z: float, first_row: int, first_column: int, least: float, sizes: FloatArray
) -> Counts:
    """`Counts` of a map against the one before, whose sample (0, 0) is (``first_row``, ``first_column``) of the world's
    lattice; changes below ``least`` [m] are none. Writes by how much each known place changed, ``sizes`` (known,) [m].
    """
    rows, columns = heights.shape
    down, along = lattice.stride
    high, wide = lattice.steps.shape
    known, changed, reverses, tilted, agreeing, tilt = 0, 0, 0, 0, 0, 0.0
    for i in range(-(-first_row // down), (first_row + rows - 1) // down + 1):
        for j in range(-(-first_column // along), (first_column + columns - 1) // along + 1):
            row, column = i * down - first_row, j * along - first_column
            cell, last = lattice.cells[i % high, j % wide], lattice.heights[i % high, j % wide]
            if cell[0] != i or cell[1] != j:
                cell[0], cell[1] = i, j
                last[:] = math.nan
                lattice.steps[i % high, j % wide] = 0.0
            left = change_at(last, 0, height_at(heights, z, row, column - 1))
            step = change_at(last, 1, height_at(heights, z, row, column))
            right = change_at(last, 2, height_at(heights, z, row, column + 1))
            if not math.isnan(step):
                sizes[known] = abs(step)
                known += 1
            if abs(step) >= least:
                before = lattice.steps[i % high, j % wide]
                changed += before != 0.0
                reverses += step * before < 0.0
                lattice.steps[i % high, j % wide] = step
            if abs(step - left) >= least and abs(right - step) >= least:
                tilted += 1
                agreeing += (step - left) * (right - step) > 0.0
                tilt += abs(step - left)
    return Counts(float(known), float(changed), float(reverses), float(tilted), float(agreeing), tilt)


@compiled
def change_at(last: FloatArray, index: int, height: float) -> float:
    """By how much a height changed to the one that takes its place [m]."""
    change: float = height - last[index]
    last[index] = height
    return change
