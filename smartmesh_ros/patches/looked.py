"""How bodies were last looked at, and for how long that holds."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.choice import FIXED
from smartmesh_ros.patches.lively import MANY
from smartmesh_ros.patches.moving import Moving
from smartmesh_ros.patches.ranges import HORIZON
from smartmesh_ros.patches.standing import Standing
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# A look costs about the same for one body as for a hundred: who has used up this share of a choice goes with others,
# unless they are so many that some are due in every step.
EARLY = 0.5
# Ground that accelerates by more is not waited for [m/s^2].
SWERVE = 20.0

_FILLS = {
    "normal": (0.0, 0.0, 1.0),
    "lean": 0.0,
    "rise": 0.0,
    "where": 0.0,
    "since": 0.0,
    "drop": 0.0,
    "slide": 0.0,
    "version": -1,
    "window": 0,
}


class Looked:
    """The last look at each of N bodies.

    The ground under the body: ``normal`` (N, 3) in the world, ``lean`` (N, 2) [m]: offset of the body from its foot in
    the grid's frame, ``rise`` (N,) [m/s]: vertical velocity. ``where`` (N, 3) [m] and ``since`` (N,) [s]: where and
    when the choice was made, for so much approach, ``drop``, and sliding, ``slide`` (N,) [m]. ``version``, ``window``
    (N,): of which version of the map, and how many rings of it were looked at.
    """

    def __init__(self) -> None:
        self.normal, self.lean, self.rise = np.empty((0, 3)), np.empty((0, 2)), np.empty(0)
        self.where, self.since = np.empty((0, 3)), np.empty(0)
        self.drop, self.slide = np.empty(0), np.empty(0)
        self.version, self.window = np.empty(0, np.int64), np.empty(0, np.int64)

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def forget(self, bodies: IntArray | slice) -> None:
        """Forgets how the ground runs under bodies."""
        self.normal[bodies] = (0.0, 0.0, 1.0)
        self.lean[bodies] = 0.0

    def due(self, standing: Standing, heightmap: HeightMap, moving: Moving, time: float, dt: float) -> BoolArray:
        """Which bodies to look at (n,): those whose choice may not hold until the next update."""
        bodies = moving.bodies
        until, since = standing.until[bodies], self.since[bodies]
        shift = moving.positions_w + moving.moved_w - self.where[bodies]
        shift[:, 2] -= self.rise[bodies] * (time + dt - since)
        drop = np.einsum("ij,ij->i", shift, self.normal[bodies])
        slide = np.einsum("ij,ij->i", shift, shift)
        drop *= drop
        slide -= drop
        most_drop, most_slide = self.drop[bodies] ** 2, self.slide[bodies] ** 2
        due = (time >= until) | (drop > most_drop) | (slide > most_slide)
        steady = heightmap.moving(time) and heightmap.lifetime <= HORIZON * dt
        changed = self._changed(standing, heightmap, bodies)
        due |= changed & np.isinf(until) if steady else changed
        if due.any() and len(bodies) <= MANY:
            due |= (drop > EARLY * EARLY * most_drop) | (slide > EARLY * EARLY * most_slide)
            due |= (standing.state[bodies] != FIXED) & (time + dt - since >= EARLY * (until - since))
        return np.asarray(due)

    def _changed(self, standing: Standing, heightmap: HeightMap, bodies: IntArray) -> BoolArray:
        """Under which bodies there is other ground than they were looked at with (n,)."""
        version = self.version[bodies]
        if (version == heightmap.version).all():
            return np.zeros(len(bodies), bool)
        rows, columns = standing.rows[bodies], standing.columns[bodies]
        return heightmap.clocks.changed(rows, columns, self.window[bodies], version)

    def changing(self, bodies: IntArray, rise: FloatArray, time: float, dt: float) -> FloatArray:
        """How fast the ground's velocity ``rise`` (n,) [m/s] has changed since the last look (n,) [m/s^2], NaN where
        that is too long ago."""
        since = time - self.since[bodies]
        recent = (since > 0.0) & (since <= 2.0 * HORIZON * dt)
        change = np.abs(rise - self.rise[bodies])
        return np.where(recent, np.minimum(change / np.where(recent, since, 1.0), SWERVE), np.nan)

    def step(self, moving: Moving, dt: float) -> tuple[FloatArray, FloatArray]:
        """How far bodies come across the ground and go along it in one step (n,) [m]."""
        shift = moving.moved_w.copy()
        shift[:, 2] -= self.rise[moving.bodies] * dt
        across = np.abs(np.einsum("ij,ij->i", shift, self.normal[moving.bodies]))
        return across, np.sqrt(np.maximum(np.einsum("ij,ij->i", shift, shift) - across * across, 0.0))
