"""How the ground's velocity will have changed by the time it is felt.

The velocity worked out from two maps is the mean over the time between them, half an interval ago; carried on over the
next interval it lags by a whole one, and ground that accelerates runs into the bodies on it (by a T^2: 12 mm at 5 m/s^2
and 20 Hz). The change from map to map, seen where a body stands, tells the acceleration. It counts only as far as the
change before agrees, so that ground which jolts or stops is not carried past its velocity.
"""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PlaneBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.fields import Fields
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.motion import PATIENCE

_FILLS = {"_stamps": np.nan, "_centres": 0.0, "_twists": 0.0, "_changes": 0.0, "_accelerations": 0.0}


class Prediction:
    """Vertical acceleration of the ground under followers, by the follower's index."""

    def __init__(self) -> None:
        self._stamps = np.empty(0)  # time of the map that was seen last [s]
        # How it moved then: the patch's centre [m], vertical velocity there [m/s] and turning about x and y [rad/s].
        self._centres = np.empty((0, 3))
        self._twists = np.empty((0, 3))
        self._changes = np.empty(0)  # acceleration from the map before to that one [m/s^2]
        self._accelerations = np.empty(0)  # what of it counts [m/s^2]

    def adopt(self, kept: IntArray) -> None:
        """Says which followers there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def ahead(
        self, batch: GridBatch | PlaneBatch | Fields, time: float, dt: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """How much higher (n,) [m] and faster (n,) [m/s] the ground under a batch's bodies is in the middle of the step
        of ``dt`` [s] from ``time`` [s] than the map's constant velocity has it; None where nothing can be said."""
        heightmap, bodies = batch.heightmap, batch.bodies
        interval, age = heightmap.lifetime, time - heightmap.time
        steady = heightmap.alike and heightmap.moving(time) and 0.0 <= age <= PATIENCE * interval and interval > 0.0
        if heightmap.motion.mode != "extrapolate" or not steady:
            self._stamps[bodies] = np.nan
            self._changes[bodies] = self._accelerations[bodies] = 0.0
            return None
        fresh = self._stamps[bodies] != heightmap.time
        if fresh.any():
            new = bodies[fresh]
            # Both at the body's foot: its patch may have another centre than it had.
            feet_w = batch.centres_w[fresh] if batch.points_w is None else batch.points_w[fresh]
            centres = batch.centres_w[fresh]
            twists = np.concatenate([batch.linear_w[fresh, 2:], batch.angular_w[fresh, :2]], axis=1)
            rates, rates_before = (
                _rates(twists, feet_w - centres),
                _rates(self._twists[new], feet_w - self._centres[new]),
            )
            changes = (rates - rates_before) / interval
            changes[np.isnan(self._stamps[new] + changes)] = 0.0
            before = self._changes[new]
            agreed = np.where(
                changes * before > 0.0, np.sign(changes) * np.minimum(np.abs(changes), np.abs(before)), 0.0
            )
            self._accelerations[new], self._changes[new] = agreed, changes
            self._centres[new], self._twists[new], self._stamps[new] = centres, twists, heightmap.time
        acceleration = self._accelerations[bodies]
        lag = 0.0 if heightmap.velocity_given else interval
        return 0.5 * acceleration * age * (age + lag), acceleration * (0.5 * lag + age + 0.5 * dt)


def _rates(twists: FloatArray, arms: FloatArray) -> FloatArray:
    """Vertical velocity (n,) [m/s] of points at ``arms`` (n, 3) [m] from centres that move with ``twists`` (n, 3):
    vertical velocity, turning about x and about y."""
    rates: FloatArray = twists[:, 0] + twists[:, 1] * arms[:, 1] - twists[:, 2] * arms[:, 0]
    return rates
