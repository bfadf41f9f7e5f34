"""Colliders of followers on ground that is flat where they can touch it: boxes with their tops along the ground."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.patches.batch import PlaneBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Where boxes wait that no body needs, far below and apart from one another [m].
_PARK_DEPTH = -2.0e5
_PARK_STEP = 1.0e3

# A plane that turned or rose less than this is not worth moving the box for [-, m].
SAME_PLANE = 1e-7

_FILLS = {"_sizes": 0.0, "_boxes": -1, "_points": np.nan, "_normals": np.nan, "_twists": 0.0}


class Planes:
    """The boxes under followers, by the follower's index.

    A box and not PyBullet's endless plane, whose bounds would meet those of every other body. It is a multibody,
    because the contacts of a fixed rigid body do not see its velocity, and as thick as it is wide, so that nothing
    falls through it.
    """

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self.moves = 0
        self._client = client
        self._pairs = pairs
        self._calls = BulletCalls(client)
        self._shapes: dict[float, int] = {}
        self._free: dict[float, list[int]] = defaultdict(list)
        self._followers: list[Follower] = []
        # The followers' boxes: half of their edges [m], 0 = none, and bodies.
        self._sizes = np.empty(0)
        self._boxes = np.empty(0, np.int64)
        # What they were last given: middle of the top [m], its normal, and the twist [m/s, rad/s].
        self._points = np.empty((0, 3))
        self._normals = np.empty((0, 3))
        self._twists = np.empty((0, 6))

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept``: each one's index before, -1 = new."""
        carry_over(self, _FILLS, kept)
        self._followers = followers

    def apply(
        self, batch: PlaneBatch, rows: IntArray, radii: FloatArray, rise: FloatArray, twist: FloatArray | None
    ) -> None:
        """Gives the followers in ``rows`` (m,) of a batch, whose bounding ``radii`` (m,) are given [m], their boxes.

        ``rise`` (m,) [m]: how much higher they stand than the batch says; ``twist`` (m, 6): velocity of the ground at
        the patch's centre [m/s, rad/s], None = at rest.
        """
        bodies, points, normals = batch.bodies[rows], batch.points_w[rows], batch.normals_w[rows]
        points[:, 2] += rise
        for place in np.flatnonzero(self._sizes[bodies] < 2.0 * radii).tolist():
            self._fit(int(bodies[place]), float(radii[place]))
        sizes, old = self._sizes[bodies], self._points[bodies]
        aside = points - old
        off = np.einsum("ij,ij->i", aside, normals)
        near = np.einsum("ij,ij->i", aside, aside) < (0.25 * sizes) ** 2
        turned = np.abs(normals - self._normals[bodies]).max(axis=1)
        same = near & (np.abs(off) <= SAME_PLANE) & (turned <= SAME_PLANE)
        old_twist = self._twists[bodies]
        if twist is None:
            twist = np.zeros_like(old_twist)
        moved = ~same | old_twist.any(axis=1)
        if moved.any():
            self.moves += int(moved.sum())
            chosen = bodies[moved]
            self._points[chosen], self._normals[chosen] = points[moved], normals[moved]
            base = points[moved] - sizes[moved, None] * normals[moved]
            self._calls.set_poses(self._boxes[chosen].tolist(), base.tolist(), _orientations(normals[moved]).tolist())
        pushed = (moved & twist.any(axis=1)) | (twist != old_twist).any(axis=1)
        if pushed.any():
            chosen, base_twist = bodies[pushed], twist[pushed].copy()
            self._twists[chosen] = twist[pushed]
            arm = self._points[chosen] - sizes[pushed, None] * self._normals[chosen] - batch.centres_w[rows[pushed]]
            base_twist[:, :3] += np.cross(base_twist[:, 3:], arm)
            self._calls.set_velocities(self._boxes[chosen].tolist(), base_twist.tolist())

    def release(self, index: int) -> None:
        """Takes a follower's box away, if it has one."""
        size = float(self._sizes[index])
        if size:
            follower, box = self._followers[index], int(self._boxes[index])
            self._pairs.part(box, follower.body, follower.link)
            self._client.resetBasePositionAndOrientation(box, [box * _PARK_STEP, 0.0, _PARK_DEPTH], [0, 0, 0, 1])
            self._client.resetBaseVelocity(box, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
            self._free[size].append(box)
            self._sizes[index] = 0.0
            follower.collider = None

    def _fit(self, index: int, radius: float) -> None:
        """Gives a follower a box with room for it; sizes are few, so that boxes can be handed on."""
        self.release(index)
        size = 2.0 ** math.ceil(math.log2(3.0 * radius))
        follower = self._followers[index]
        free = self._free[size]
        if free:
            box = free.pop()
        else:
            if size not in self._shapes:
                self._shapes[size] = self._client.createCollisionShape(pb.GEOM_BOX, halfExtents=[size] * 3)
            box = self._client.createMultiBody(0.0, self._shapes[size], basePosition=[0.0, 0.0, _PARK_DEPTH])
            # PyBullet multiplies the two coefficients of a contact: the body's alone decide.
            self._client.changeDynamics(box, -1, lateralFriction=1.0, restitution=1.0)
            self._pairs.claim(box)
        self._pairs.join(box, follower.body, follower.link)
        follower.collider = box
        self._sizes[index], self._boxes[index] = size, box
        self._points[index] = np.nan
        self._normals[index] = np.nan
        self._twists[index] = 0.0


def _orientations(normals: FloatArray) -> FloatArray:
    """The shortest turns (x, y, z, w) that take z to unit ``normals`` (n, 3) with z above -1."""
    turn = np.empty((len(normals), 4))
    w = np.sqrt(0.5 * (1.0 + normals[:, 2]))
    turn[:, 0] = -normals[:, 1] / (2.0 * w)
    turn[:, 1] = normals[:, 0] / (2.0 * w)
    turn[:, 2] = 0.0
    turn[:, 3] = w
    return turn
