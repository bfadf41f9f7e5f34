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
from smartmesh_ros.physics.carrying import Carried, cross, velocity_below
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.physics.prediction import Ahead
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# Where boxes wait that no body needs, far below and apart from one another [m].
_PARK_DEPTH = -2.0e5
_PARK_STEP = 1.0e3

# Boxes whose top lies so near to the plane are left where they are [m, -]; PyBullet moves them on with their velocity.
SAME_PLANE = 1e-7
CARRIED, CARRIED_TURN = 2e-5, 1e-4

# A box stays where it is while its body moves by less than this share of its size, as judged at every look (ASIDE) and
# between looks.
ASIDE, BETWEEN = 0.25, 0.125
# Half of the edges of boxes, by how far their bodies reach until the next look, at least: so much that they stay over
# them.
LEAST = 1.05 / (1.0 - ASIDE - BETWEEN)

_FILLS = {"_sizes": 0.0, "_normals": np.nan, "_points": np.nan}


class Planes:
    """The boxes under followers, by the follower's index.

    A box and not PyBullet's endless plane, whose bounds would meet those of every other body. It is a multibody,
    because the contacts of a fixed rigid body do not see its velocity, and as thick as it is wide, so that nothing
    falls through it.
    """

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self._client = client
        self._pairs = pairs
        self._calls = BulletCalls(client)
        self._shapes: dict[float, int] = {}
        self._free: dict[float, list[int]] = defaultdict(list)
        self._followers: list[Follower] = []
        # The followers' boxes: half of their edges [m], 0 = none, and the normal of their top.
        self._sizes = np.empty(0)
        self._normals = np.empty((0, 3))
        self._points = np.empty((0, 2))  # where the body was over the plane when the box was last looked at [m]
        self._carried = Carried(client)

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept``: each one's index before, -1 = new."""
        carry_over(self, _FILLS, kept)
        self._carried.adopt(kept)
        self._followers = followers

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on and boxes did not."""
        self._carried.stand_still(duration)

    def held(self, batch: PlaneBatch, positions_w: FloatArray, reach: FloatArray, time: float) -> BoolArray:
        """Whose box moves on with its plane (m,), and needs no look at ``time`` [s]; ``positions_w``, ``reach``: as in
        `apply`."""
        bodies, sizes = batch.bodies, self._sizes[batch.bodies]
        slid = np.abs(batch.points_w[:, :2] - self._points[bodies]).max(axis=1)
        same = self._carried.same_ground(bodies, batch.since, time)
        return np.asarray(same & (slid < BETWEEN * sizes) & ~self.outrun(bodies, positions_w, reach))

    def outrun(self, bodies: IntArray, positions_w: FloatArray, reach: FloatArray) -> BoolArray:
        """Which bodies (m,) at ``positions_w`` (m, 3) [m] may leave their boxes before the next update, although their
        plane is the same; ``reach`` (m,) [m]: as in `apply`."""
        sizes, normals = self._sizes[bodies], self._normals[bodies]
        aside = positions_w - self._carried.bases[bodies]
        aside -= np.einsum("ij,ij->i", aside, normals)[:, None] * normals
        far = np.einsum("ij,ij->i", aside, aside) > ((ASIDE + BETWEEN) * sizes) ** 2
        return np.asarray(far | (sizes < LEAST * reach))

    def go_on(self, bodies: IntArray, faster: FloatArray, time: float) -> None:
        """Has boxes of followers (m,) move on with their planes, ``faster`` (m,) [m/s] upwards than these were said to
        be."""
        self._carried.hasten(bodies, faster, time)

    def apply(
        self,
        batch: PlaneBatch,
        rows: IntArray,
        positions_w: FloatArray,
        reach: FloatArray,
        ahead: Ahead,
        time: float,
        *,
        carry_velocity: bool,
    ) -> None:
        """Gives the followers in ``rows`` (m,) of a batch, at ``positions_w`` (m, 3) [m], their boxes at ``time`` [s],
        by as much as the ground is ``ahead`` of the batch. ``reach`` (m,) [m]: their bounding radii and how far they go
        until the next update."""
        bodies, normals = batch.bodies[rows], batch.normals_w[rows]
        # On ground at rest the plane's point is where the body was when it was looked at.
        above = np.einsum("ij,ij->i", positions_w - batch.points_w[rows], normals)
        points = positions_w - above[:, None] * normals
        points[:, 2] += ahead.higher
        for place in np.flatnonzero(self._sizes[bodies] < LEAST * reach).tolist():
            self._fit(int(bodies[place]), float(reach[place]))
        carried, old = self._carried, self._normals[bodies]
        self._normals[bodies] = old + cross(carried.advance(bodies, time), old)
        self._points[bodies] = points[:, :2]
        sizes = self._sizes[bodies]
        lower = sizes[:, None] * normals
        astray = np.flatnonzero(~self._fits(bodies, points, normals, sizes))
        if astray.size:
            chosen, base = bodies[astray], points[astray] - lower[astray]
            carried.bases[chosen], self._normals[chosen], carried.twists[chosen] = base, normals[astray], 0.0
            turns = _orientations(normals[astray])
            self._calls.set_poses(carried.colliders[chosen].tolist(), base.tolist(), turns.tolist())
        twist = np.zeros((len(bodies), 6))
        if carry_velocity:
            twist[:, :3], twist[:, 3:] = batch.linear_w[rows], batch.angular_w[rows]
            centres = batch.centres_w[rows]
            twist[:, :3] += cross(twist[:, 3:], carried.bases[bodies] - centres)
            twist[:, :3] += velocity_below(twist[:, 3:], batch.points_w[rows, 2] - centres[:, 2])
        carried.push(bodies, twist, ahead.faster, batch.since[rows])

    def _fits(self, bodies: IntArray, points: FloatArray, normals: FloatArray, sizes: FloatArray) -> BoolArray:
        """Whether the tops of the boxes lie along planes, given by points and normals (m, 3), and under the bodies."""
        old = self._normals[bodies]
        aside = points - self._carried.bases[bodies] - sizes[:, None] * old
        off = np.abs(np.einsum("ij,ij->i", aside, normals))
        turned = np.abs(normals - old).max(axis=1)
        moves = self._carried.twists[bodies].any(axis=1)
        # Not so either where a box is new.
        fits = (off <= np.where(moves, CARRIED, SAME_PLANE)) & (turned <= np.where(moves, CARRIED_TURN, SAME_PLANE))
        return np.asarray(fits & (np.einsum("ij,ij->i", aside, aside) < (ASIDE * sizes) ** 2))

    def put_away(self, indices: IntArray) -> None:
        """Has the boxes of followers wait far away until they are needed again."""
        if indices.size:
            boxes = self._carried.colliders[indices].tolist()
            self._calls.set_positions(boxes, [[box * _PARK_STEP, 0.0, _PARK_DEPTH] for box in boxes], [0, 0, 0, 1])
            self._carried.forget(indices)

    def release(self, index: int) -> None:
        """Takes a follower's box away, if it has one."""
        size = float(self._sizes[index])
        if size:
            follower, box = self._followers[index], int(self._carried.colliders[index])
            self._pairs.part(box, follower.body, follower.link)
            self.put_away(np.array([index]))
            self._free[size].append(box)
            self._sizes[index] = 0.0
            follower.collider = None

    def _fit(self, index: int, reach: float) -> None:
        """Gives a follower a box with room for it; sizes are few, so that boxes can be handed on."""
        self.release(index)
        size = 2.0 ** (0.5 * math.ceil(2.0 * math.log2(LEAST * reach)))
        size = size if size >= LEAST * reach else size * math.sqrt(2.0)  # as rounding has it
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
        self._sizes[index], self._carried.colliders[index] = size, box
        self._carried.forget(index)


def _orientations(normals: FloatArray) -> FloatArray:
    """The shortest turns (x, y, z, w) that take z to unit ``normals`` (n, 3) with z above -1."""
    turn = np.empty((len(normals), 4))
    w = np.sqrt(0.5 * (1.0 + normals[:, 2]))
    turn[:, 0] = -normals[:, 1] / (2.0 * w)
    turn[:, 1] = normals[:, 0] / (2.0 * w)
    turn[:, 2] = 0.0
    turn[:, 3] = w
    return turn
