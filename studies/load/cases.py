"""The cases of the load study."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

Mode = Literal["full", "regions"]

RESOLUTION = 0.1
# Distance of the bodies, and their radius [m].
SPACING, RADIUS = 0.45, 0.15
# The wave under them: amplitude [m], wave number [rad/m] and angular frequency [rad/s].
WAVE = (0.05, 1.0, 4.0)
# Width [m] and slope of the rim around the moving part. Bodies up to 1.4 m/s cannot cross it.
RIM, RIM_SLOPE = 0.4, 0.5
# The probe is a tracked body over flat ground that jumps between CODES heights, so that the markers identify the map:
# radius, height of the probe's centre, rise from code to code [m].
PROBE_RADIUS, PROBE_HEIGHT, CODES, RISE = 0.5, 0.375, 4, 0.25
# Speed above which ground counts as having jumped: above the wave's speed, below that of the jumps [m/s].
MAX_VELOCITY = 1.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """One run: a map of ``side`` x ``side`` samples, ``bodies`` spheres, whole maps or regions at ``map_rate`` [Hz],
    physics at ``physics_rate`` [Hz] for ``seconds`` [s]. ``resting``: number of the bodies that lie on ground at rest;
    the others are on the moving part. ``markers``: whether they are listened to.
    """

    side: int
    bodies: int
    mode: Mode
    map_rate: float
    physics_rate: float
    markers: bool = True
    seconds: float = 6.0
    resting: int = 0

    @property
    def row(self) -> int:
        """Bodies on one side of the square that those on the moving part are spawned in."""
        return math.ceil(math.sqrt(self.bodies - self.resting))

    @property
    def window(self) -> int:
        """Samples on one side of the part of the map that moves, whose first sample is (0, 0)."""
        return 64 if self.row <= 10 else 192

    @property
    def probe(self) -> tuple[float, float]:
        """Where the probe is [m]: beside the bodies, within the window."""
        edge = (self.window - 1) * RESOLUTION
        return edge - 0.75, 0.5 * edge

    def parameters(self) -> dict[str, object]:
        """Parameters of the node."""
        moving = self.bodies - self.resting
        places = [(0.4 + SPACING * (i % self.row), 0.4 + SPACING * (i // self.row)) for i in range(moving)]
        side, first = math.ceil(math.sqrt(self.resting)), self.window * RESOLUTION + 2.0
        places += [(first + SPACING * (i % side), first + SPACING * (i // side)) for i in range(self.resting)]
        spawn = [
            f"{{id: ball_{i}, shape: sphere, size: [{RADIUS}], mass: 1.0, "
            f"xy: [{x:.2f}, {y:.2f}], above: {RADIUS + 0.02}}}"
            for i, (x, y) in enumerate(places)
        ]
        return {
            "physics.rate": self.physics_rate,
            # Those of each step, where there are few enough to listen to.
            "publish.patches": self.physics_rate if self.bodies <= 100 else 60.0,
            "terrain.max_velocity": MAX_VELOCITY,
            "bodies.spawn": spawn,
        }


def groups() -> dict[str, list[Case]]:
    """Return all cases by the table that they are in: the grid bodies x maps x rates, in which each axis is varied with
    the others at their middle values, and the corners of the targets are added; how memory grows with the map; and nine
    of ten bodies at rest."""
    middle = Case(side=1024, bodies=100, mode="regions", map_rate=60.0, physics_rate=240.0)
    many = replace(middle, bodies=1000, physics_rate=60.0)
    rest = replace(middle, bodies=1000, resting=900, markers=False)
    grid = [
        replace(middle, bodies=bodies, physics_rate=rate) for rate in (240.0, 60.0) for bodies in (1, 10, 100, 1000)
    ]
    for side in (256, 1024, 4096):
        rates = (10.0, 30.0, 60.0) if side < 4096 else (5.0,)
        grid += [replace(middle, side=side, mode="full", map_rate=rate) for rate in rates]
        grid += [replace(middle, side=side, map_rate=rate) for rate in (10.0, 30.0, 60.0)]
    grid += [replace(many, side=side) for side in (256, 4096)]
    grid += [replace(many, mode="full", map_rate=rate) for rate in (10.0, 30.0)]
    few = replace(middle, bodies=10, physics_rate=60.0, markers=False)
    memory = [replace(few, side=side, mode="full", map_rate=1.0) for side in (256, 4096)]
    memory.append(replace(few, side=8192, mode="full", map_rate=0.3, seconds=10.0))
    memory += [replace(few, side=side, map_rate=30.0) for side in (256, 4096, 8192, 16384)]
    more = replace(rest, bodies=5000, resting=4500, physics_rate=60.0, seconds=10.0)
    return {"grid": list(dict.fromkeys(grid)), "memory": memory, "rest": [rest, more]}
