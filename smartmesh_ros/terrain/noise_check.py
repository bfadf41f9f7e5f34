"""Detection of sensor noise and mapper corrections in maps that are treated as maps of moving ground.

Moving ground is smooth: from map to map a sample keeps its direction, and changes vary smoothly from sample to sample.
Maps of sensors and mappers show two effects that are no motion:

- *Noise*. Changes reverse from map to map, and differ at random between neighbouring samples. Waves look alike only if
  they are sampled by fewer than ten maps a period and, at the same time, fewer than five samples a wavelength.
- *Jumps*. Most of the ground is at rest, changes its height from one map to the next, and is at rest again. A loop
  closure of a mapper does that.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.grid_track import cells_moved, same_grid
from smartmesh_ros.terrain.heightmap import HeightMap

# Mean absolute difference between the changes of two samples with noise of standard deviation one.
MEAN_DIFFERENCE = math.sqrt(8.0 / math.pi)


@dataclass(frozen=True, kw_only=True)
class NoiseCheckConfig:
    """Thresholds of the detection.

    ``samples``: maximum number of compared samples along each side of the map.
    ``least_change`` [m]: smaller changes are ignored, because contacts of heavy bodies give way by as much.
    ``reversed`` [-]: minimum fraction of changes that reverse the change before. White noise has 2/3, a drifting mapper
    1/4 and more, periodic motion sampled n times a period 2 / n.
    ``agreeing`` [-]: maximum fraction of places where changes tilt in the same direction on both sides of a sample.
    White noise has 1/3, smoothed noise 1/2, a wave sampled n times a wavelength 1 - 2 / n along its direction.
    ``share`` [-]: minimum fraction of samples that change from map to map; fewer changes may come from a wheel or tool.
    ``changes``, ``maps``: minimum numbers of changes and maps for a result. ``lasting`` [s]: minimum duration of noise.
    ``memory`` [s]: time constant of the decay of counts.
    ``least_jump`` [m]: smaller jumps are ignored, because they throw no bodies. ``acceleration`` [m/s^2]: ground that
    needs no more than this to get from rest to rest between two maps may be a lift or a platform.
    ``rest`` [s]: time at rest before and after a jump. ``still`` [-]: maximum speed of ground at rest from map to map,
    as a fraction of the jump's. ``hold`` [s]: time after which findings expire.
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
    """Standard deviation of the ``noise`` [m], to a tenth of it, and largest ``jump`` [m]; 0 = not detected."""

    noise: float
    jump: float

    def __str__(self) -> str:
        noise = f"noise of {1e3 * self.noise:.1f} mm" if self.noise > 0.0 else ""
        jumps = f"jumps of still ground by up to {100.0 * self.jump:.1f} cm" if self.jump > 0.0 else ""
        return " and ".join(part for part in (noise, jumps) if part)


NO_FINDINGS = Findings(0.0, 0.0)


class Change(NamedTuple):
    """Change to the map of a ``time`` [s]: median change of height ``step`` [m], and ``interval`` [s] between maps."""

    time: float
    step: float
    interval: float

    @property
    def speed(self) -> float:
        """Of the change [m/s]: where maps are missing, that of moving ground stays and its step grows."""
        return self.step / self.interval


class NoiseCheck:
    """Checks the whole maps of one tile, in order of their time. ``findings``: the result so far."""

    def __init__(self) -> None:
        self.config = NoiseCheckConfig()
        self.findings = NO_FINDINGS
        self._time = self._last_found = -math.inf  # times of the last map and of the last detection [s]
        self._geometry: GridGeometry | None = None
        self._lattice, self._first = CORE.SampleLattice(0, 0, self.config.samples), (0, 0)
        self._maps, self._counts = 0.0, np.zeros(6)  # number of maps, and counts in them, both decaying
        self._noisy_since = math.inf  # [s]
        self._start = -math.inf  # time of the first map [s]
        self._new, self._old = deque[Change](), deque[Change]()  # changes of the last ``rest`` seconds, and before

    def take(self, heightmap: HeightMap, time: float) -> None:
        """Check a height map after its whole map of ``time`` [s]. Noise is ignored if the height map has a variance."""
        geometry, heights, motion = heightmap.geometry, heightmap.heights, heightmap.motion
        interval = time - self._time
        if 0.0 <= interval < motion.min_interval:
            return  # a part of the same map
        if not self._follow(geometry, heights) or not 0.0 < interval <= motion.max_interval:
            self._restart(time)
        self._time = time
        found, step = self._lattice.compare(*self._placed(geometry, heights))
        fading = math.exp(-interval / self.config.memory)
        self._counts = fading * self._counts + found
        if not self._counts[0]:
            return
        self._maps = fading * self._maps + 1.0
        noise = self._noise(time) if heightmap.noise == 0.0 else 0.0
        self._record(noise, self._jump(Change(time, step, interval)), time)

    def _placed(self, geometry: GridGeometry, heights: NDArray[np.float32]) -> tuple[Any, ...]:
        """Return heights, their datum [m], the place of sample (0, 0) in the world [samples], and the tolerance [m]."""
        return heights, float(geometry.origin[2]), self._first, self.config.least_change

    def _follow(self, geometry: GridGeometry, heights: NDArray[np.float32]) -> bool:
        """Move the lattice to the position of a map; return False for a different grid, which gets a new lattice."""
        before, self._geometry = self._geometry, geometry
        if before is None or not same_grid(before, geometry):
            self._lattice, self._first = CORE.SampleLattice(*heights.shape, self.config.samples), (0, 0)
            return False
        # The samples move with a map that slides or rotates, and with one that scrolls as its ground moves.
        moved = cells_moved(before, geometry) or (0, 0)
        if moved != (0, 0) and not self._lattice.moved_as_one(*self._placed(geometry, heights)):
            self._first = (self._first[0] + moved[0], self._first[1] + moved[1])
        return True

    def _restart(self, time: float) -> None:
        """Forget the maps before ``time`` [s], but not the findings."""
        self._maps, self._counts = 0.0, np.zeros(6)
        self._noisy_since, self._start = math.inf, time
        self._new.clear()
        self._old.clear()
        self._last_found = -math.inf if self.findings == NO_FINDINGS else time
        self._lattice.forget()

    def _noise(self, time: float) -> float:
        """Return the standard deviation of the noise [m]; zero if noise is absent or has not lasted long enough."""
        config = self.config
        known, changed, reversed_, tilted, agreeing, tilt = self._counts.tolist()
        enough = self._maps >= config.maps and tilted >= config.changes
        enough = enough and changed >= max(config.changes, config.share * known)
        if not (enough and reversed_ >= config.reversed * changed and agreeing <= config.agreeing * tilted):
            self._noisy_since = math.inf
            return 0.0
        self._noisy_since = min(self._noisy_since, time)
        return float(tilt / tilted / MEAN_DIFFERENCE) if time - self._noisy_since >= config.lasting else 0.0

    def _jump(self, newest: Change) -> float:
        """Return the height of a jump [m] that the rest between it and the ``newest`` change confirms; else zero."""
        config, jump = self.config, 0.0
        self._new.append(newest)
        while self._new[0].time <= newest.time - config.rest:
            change = self._new.popleft()
            before = change.time - change.interval - config.rest
            while self._old and self._old[0].time < before:
                self._old.popleft()
            least = max(config.least_jump, 0.25 * config.acceleration * change.interval**2)
            if change.step >= least and self._start <= before:
                rests = all(other.speed <= config.still * change.speed for other in (*self._old, *self._new))
                jump = max(jump, change.step if rests else 0.0)
            self._old.append(change)
        return jump

    def _record(self, noise: float, jump: float, time: float) -> None:
        """Update the findings; they expire after ``hold`` seconds without a detection."""
        known = self.findings
        if noise > 0.0 or jump > 0.0:
            self._last_found = time
            if noise > 1.1 * known.noise or jump > known.jump:
                self.findings = Findings(max(noise, known.noise), max(jump, known.jump))
        elif time - self._last_found > self.config.hold:
            self.findings = NO_FINDINGS
