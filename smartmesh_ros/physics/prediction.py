"""How the ground's velocity will have changed by the time it is felt.

The velocity worked out from two maps is the mean over the time between them, half an interval ago; carried on over the
next interval it lags by a whole one, and ground that accelerates runs into the bodies on it (by a T^2: 12 mm at 5 m/s^2
and 20 Hz). The change from map to map, seen where a body stands, tells the acceleration. It counts only as far as the
change before agrees, so that ground which jolts or stops is not carried past its velocity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, MeshBatch, PatchBatch, PlaneBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.fields import Fields
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.motion import PATIENCE

_FILLS = {"_stamps": np.nan, "_intervals": 0.0, "_centres": 0.0, "_twists": 0.0, "_changes": 0.0, "_accelerations": 0.0}


class Ahead(NamedTuple):
    """How much ``higher`` (n,) [m] and ``faster`` upwards (n,) [m/s] ground is than its map says."""

    higher: FloatArray
    faster: FloatArray

    @classmethod
    def nothing(cls, count: int) -> Ahead:
        """Ground that is where its map says."""
        return cls(np.zeros(count), np.zeros(count))

    def of(self, rows: IntArray) -> Ahead:
        """That of ``rows``."""
        return Ahead(self.higher[rows], self.faster[rows])


class Prediction:
    """Vertical acceleration of the ground under followers, by the follower's index."""

    def __init__(self) -> None:
        self._stamps = np.empty(0)  # time of the map that was seen last [s]
        self._intervals = np.empty(0)  # from the map before to that one [s]
        # How it moved then: the patch's centre [m], vertical velocity there [m/s] and turning about x and y [rad/s].
        self._centres = np.empty((0, 3))
        self._twists = np.empty((0, 3))
        self._changes = np.empty(0)  # acceleration from the map before to that one [m/s^2]
        self._accelerations = np.empty(0)  # what of it counts [m/s^2]

    def adopt(self, kept: IntArray) -> None:
        """Says which followers there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def ahead(self, batch: PatchBatch | Fields, time: float, dt: float) -> Ahead:
        """What the ground under a batch's bodies is ahead of, in the middle of the step of ``dt`` [s] from ``time``
        [s], if the map's velocity were constant."""
        bodies = batch.bodies
        assert isinstance(batch, GridBatch | PlaneBatch | MeshBatch | Fields)
        if isinstance(batch, MeshBatch) or not ((batch.since < time) & (self._stamps[bodies] <= batch.since)).all():
            self._look(batch, time)
        acceleration = self._accelerations[bodies]
        if not acceleration.any():
            return Ahead.nothing(len(bodies))
        age, interval = time - self._stamps[bodies], self._intervals[bodies]
        given = batch.mesh.velocity_given if isinstance(batch, MeshBatch) else batch.heightmap.velocity_given
        lag = np.zeros_like(interval) if given else interval
        return Ahead(0.5 * acceleration * age * (age + lag), acceleration * (0.5 * lag + age + 0.5 * dt))

    def _look(self, batch: GridBatch | PlaneBatch | MeshBatch | Fields, time: float) -> None:
        """Looks whether there are newer maps, and how the ground's velocity has changed in them."""
        bodies = batch.bodies
        if isinstance(batch, MeshBatch):
            motion, stamps, interval = batch.mesh.motion, np.array([batch.mesh.time]), np.array([batch.mesh.lifetime])
        else:
            motion = batch.heightmap.motion
            stamps, interval = batch.heightmap.clocks.of(batch.rows, batch.columns)
        age = time - stamps
        steady = (age >= 0.0) & (age <= PATIENCE * interval) & (interval > 0.0)
        if motion.mode != "extrapolate":
            steady[:] = False
        if not steady.all():
            self._stamps[bodies[~steady]] = np.nan
            self._changes[bodies[~steady]] = self._accelerations[bodies[~steady]] = 0.0
        fresh = steady & (self._stamps[bodies] != stamps)
        if not fresh.any():
            return
        new, stamps, interval = bodies[fresh], stamps[fresh], interval[fresh]
        # Both at the body's foot: its patch may have another centre than it had.
        centres = batch.centres_w[fresh]
        feet_w = centres if batch.points_w is None else batch.points_w[fresh]
        twists = np.concatenate([batch.linear_w[fresh, 2:], batch.angular_w[fresh, :2]], axis=1)
        change = _rates(twists, feet_w - centres) - _rates(self._twists[new], feet_w - self._centres[new])
        changes = change / (stamps - self._stamps[new])  # there may have been maps in between that nobody looked at
        changes[np.isnan(changes)] = 0.0
        before = self._changes[new]
        agreed = np.sign(changes) * np.minimum(np.abs(changes), np.abs(before))
        self._accelerations[new], self._changes[new] = np.where(changes * before > 0.0, agreed, 0.0), changes
        self._centres[new], self._twists[new] = centres, twists
        self._stamps[new], self._intervals[new] = stamps, interval


def _rates(twists: FloatArray, arms: FloatArray) -> FloatArray:
    """Vertical velocity (n,) [m/s] of points at ``arms`` (n, 3) [m] from centres that move with ``twists`` (n, 3):
    vertical velocity, turning about x and about y."""
    rates: FloatArray = twists[:, 0] + twists[:, 1] * arms[:, 1] - twists[:, 2] * arms[:, 0]
    return rates
