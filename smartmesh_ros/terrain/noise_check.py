"""Whether whole maps look like those of a sensor or mapper, although they are taken for maps of ground that moves.

Ground that moves goes on: from one map to the next a sample keeps its direction, and the ground tilts smoothly from
sample to sample. Two things that maps of sensors and mappers do are no motion:

- *Noise*. Changes reverse from map to map, and those of neighbouring samples differ at random. Waves look so only where
  maps have fewer than ten instants a period and, at the same time, fewer than five samples a wavelength.
- *Jumps*. Most of the ground is at rest, is somewhere else in the next map, and is at rest again: a closed loop.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.grid_track import cells_moved
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.sample_lattice import NO_COUNTS, FloatGrid, compare, lattice_of, moved_as_one

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

    samples: int = 12
    least_change: float = 0.0005
    reversed: float = 0.2
    agreeing: float = 0.6
    share: float = 0.03
    changes: int = 50
    maps: int = 5
    lasting: float = 1.0
    memory: float = 2.0
    least_jump: float = 0.01
    acceleration: float = 5.0
    rest: float = 1.0
    still: float = 0.25
    hold: float = 30.0


class Findings(NamedTuple):
    """What maps of ground at rest showed: the standard deviation of their ``noise`` [m], to a tenth of it, and the
    largest ``jump`` [m]; zero where there was none."""

    noise: float
    jump: float

    def __str__(self) -> str:
        noise = f"noise of {1e3 * self.noise:.1f} mm" if self.noise > 0.0 else ""
        jumps = f"jumps of still ground by up to {100.0 * self.jump:.1f} cm" if self.jump > 0.0 else ""
        return " and ".join(part for part in (noise, jumps) if part)


NO_FINDINGS = Findings(0.0, 0.0)


class Change(NamedTuple):
    """By how much most of the ground changed to the map at a ``time`` [s], the median ``step`` [m], and the time since
    the map before, ``interval`` [s]."""

    time: float
    step: float
    interval: float


class NoiseCheck:
    """Looks at the whole maps of one tile, in the order of their time. ``seen``: what they show; see `Findings`."""

    def __init__(self, config: NoiseCheckConfig | None = None) -> None:
        self.config = config or NoiseCheckConfig()
        self.findings = NO_FINDINGS
        self._time = self._last_found = -math.inf  # of the last map, and when it was seen that ground does not move so [s]
        self._geometry: GridGeometry | None = None
        self._lattice, self._first = lattice_of((0, 0), self.config.samples), (0, 0)
        self._maps, self._counts = 0.0, NO_COUNTS  # how many maps count, and what was counted in them
        self._noisy_since = math.inf  # [s]
        self._changes: deque[Change] = deque()  # of the last time of rest
        self._jumped: Change | None = None  # what may be a jump
        self._before = -math.inf  # the last map before these changes [s]

    def take(self, heightmap: HeightMap, time: float) -> None:
        """Takes note of a whole map of ``time`` [s] that a height map has taken. Noise that it was told of counts for
        nothing."""
        geometry, heights, motion = heightmap.geometry, heightmap.heights, heightmap.motion
        interval = time - self._time
        if 0.0 <= interval < motion.min_interval:
            return  # the same map in parts
        if not self._follow(geometry, heights) or not 0.0 < interval <= motion.max_interval:
            self._restart(time)
        self._time = time
        height, least = float(geometry.origin[2]), self.config.least_change
        fading = math.exp(-interval / self.config.memory)
        self._counts, step = compare(self._lattice, heights, height, *self._first, least, self._counts, fading)
        if not self._counts.known:
            return
        self._maps = fading * self._maps + 1.0
        noise = self._noise(time) if heightmap.noise == 0.0 else 0.0
        self._record(noise, self._jump(Change(time, step, interval)), time)

    def _follow(self, geometry: GridGeometry, heights: FloatGrid) -> bool:
        """Moves the lattice to where a map lies; False where it is another grid, whose lattice is new."""
        before, self._geometry = self._geometry, geometry
        if geometry == before:
            return True
        size = (geometry.rows, geometry.columns, geometry.resolution)
        if before is None or size != (before.rows, before.columns, before.resolution):
            self._lattice, self._first = lattice_of(heights.shape, self.config.samples), (0, 0)
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
        self._jumped, self._before = None, time
        self._last_found = -math.inf if self.findings == NO_FINDINGS else time
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

    def _jump(self, change: Change) -> float:
        """Height of a jump [m] that rest after it has shown up to the newest ``change``; zero where there was none."""
        config, last = self.config, self._jumped
        if last is not None and change.step > config.still * last.step:
            self._jumped = last = None
        if change.step >= max(config.least_jump, 0.25 * config.acceleration * change.interval**2):
            self._jumped = last = change if self._rested_before(change) else None
        self._changes.append(change)
        while self._changes[0].time < change.time - config.rest:
            self._before = self._changes.popleft().time
        if last is None or change.time - last.time < config.rest:
            return 0.0
        self._jumped = None
        return last.step

    def _rested_before(self, change: Change) -> bool:
        """Whether the ground was known and stood still before a ``change``."""
        known = change.time - change.interval - self._before >= self.config.rest
        return known and all(one.step <= self.config.still * change.step for one in reversed(self._changes))

    def _record(self, noise: float, jump: float, time: float) -> None:
        """Notes what was seen, and forgets it once it was not seen for long."""
        if noise > 0.0 or jump > 0.0:
            self._last_found = time
            worst = Findings(max(noise, self.findings.noise), max(jump, self.findings.jump))
            self.findings = worst if worst.noise > 1.1 * self.findings.noise or jump > self.findings.jump else self.findings
        elif time - self._last_found > self.config.hold:
            self.findings = NO_FINDINGS
