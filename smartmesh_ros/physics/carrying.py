"""Colliders that PyBullet itself moves on with the ground's velocity, so that few steps have to touch them."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# A collider keeps its velocity while the ground's differs by less [m/s, rad/s]: in a step that is some 10 um.
SAME_VELOCITY = 2e-3


_FILLS = {
    "colliders": -1, "bases": np.nan, "depths": 0.0, "twists": 0.0, "times": np.nan, "_since": np.nan, "_rates": 0.0,
}  # fmt: skip


class Carried:
    """Where the colliders of followers are, by the follower's index.

    ``colliders`` (N,): their bodies in PyBullet. ``bases`` (N, 3) [m]: their positions at ``times`` (N,) [s], NaN = to
    be placed anew; PyBullet has them ``depths`` (N,) [m] lower. ``twists`` (N, 6) [m/s, rad/s]: those they were given
    since, at ``bases``.
    """

    def __init__(self, client: Any) -> None:
        self.colliders = np.empty(0, np.int64)
        self.bases = np.empty((0, 3))
        self.depths = np.empty(0)
        self.twists = np.empty((0, 6))
        self.times = np.empty(0)
        # Since when the ground has gone on steadily that they were brought to [s], and its vertical velocity [m/s].
        self._since = np.empty(0)
        self._rates = np.empty(0)
        self._calls = BulletCalls(client)

    def adopt(self, kept: IntArray) -> None:
        """Says which followers there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def forget(self, followers: IntArray | int) -> None:
        """Says that the colliders of followers are elsewhere, or others."""
        self.bases[followers] = self._since[followers] = np.nan
        self.twists[followers] = 0.0

    def advance(self, followers: IntArray, time: float) -> FloatArray:
        """Notes how far steps of PyBullet have moved colliders; returns how much they turned since (n, 3) [rad]."""
        elapsed = time - self.times[followers]
        elapsed[elapsed < 0.0] = np.nan  # the clock was set back
        moved = self.twists[followers] * elapsed[:, None]
        self.bases[followers] += moved[:, :3]
        self.times[followers] = time
        return moved[:, 3:]

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on and colliders did not: they are not where the ground is."""
        self.times += duration
        self._since[:] = np.nan

    def push(self, followers: IntArray, twist: FloatArray, faster: FloatArray | float, since: FloatArray) -> None:
        """Gives colliders the twist (n, 6) [m/s, rad/s] of ground that has it ``since`` (n,) [s], ``faster`` (n,) [m/s]
        upwards, where that is another than they have."""
        self._since[followers], self._rates[followers] = since, twist[:, 2]
        twist = twist.copy()
        twist[:, 2] += faster
        old = self.twists[followers]
        changed = np.abs(twist - old).max(axis=1) > SAME_VELOCITY
        changed |= old.any(axis=1) & ~twist.any(axis=1)  # what came to rest is always told so
        self._tell(followers[changed], twist[changed])

    def hasten(self, followers: IntArray, faster: FloatArray, time: float) -> None:
        """Has colliders go on with the same ground, but ``faster`` (n,) [m/s] upwards, from ``time`` [s] on."""
        change = self._rates[followers] + faster - self.twists[followers, 2]
        changed = np.flatnonzero(np.abs(change) > SAME_VELOCITY)
        if changed.size:
            followers, change = followers[changed], change[changed]
            # As if they had always had that velocity.
            self.bases[followers, 2] -= change * (time - self.times[followers])
            twist = self.twists[followers]
            twist[:, 2] += change
            self._tell(followers, twist)

    def same_ground(self, followers: IntArray, since: FloatArray, time: float) -> BoolArray:
        """Whether the ground at ``time`` [s], steady ``since`` (n,) [s], is what the colliders were brought to (n,)."""
        return np.asarray((self._since[followers] == since) & (since < time))

    def place(self, followers: IntArray, bases: FloatArray, orientation: Any) -> None:
        """Puts colliders at ``bases`` (n, 3) [m] in one orientation (x, y, z, w). This stops them."""
        self.bases[followers], self.twists[followers] = bases, 0.0
        lower = bases.copy()
        lower[:, 2] -= self.depths[followers]
        self._calls.set_positions(self.colliders[followers].tolist(), lower.tolist(), orientation)

    def _tell(self, followers: IntArray, twist: FloatArray) -> None:
        if followers.size:
            self.twists[followers] = twist
            told = twist.copy()
            told[:, :3] += velocity_below(twist[:, 3:], self.depths[followers])
            self._calls.set_velocities(self.colliders[followers].tolist(), told.tolist())


def velocity_below(angular_w: FloatArray, depths: FloatArray) -> FloatArray:
    """How much faster what turns with ``angular_w`` (n, 3) [rad/s] moves ``depths`` (n,) [m] below a point than there
    (n, 3) [m/s].

    Ground rises and falls where it is. Where a body stands on steep ground its collider must not move sideways, into
    the body or away from it; so the vertex it is placed by, further down, must.
    """
    found = np.zeros_like(angular_w)
    found[:, 0], found[:, 1] = -angular_w[:, 1] * depths, angular_w[:, 0] * depths
    return found


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector products (n, 3); NumPy's own takes five times as long for so few."""
    product = np.empty_like(a)
    product[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    product[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    product[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product
