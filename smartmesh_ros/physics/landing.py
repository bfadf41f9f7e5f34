"""Bodies that would run into the ground within a step arrive at its surface instead, and leave it slowly.

PyBullet finds a collision only once bodies overlap: what falls at 8 m/s is 33 mm deep in the ground at 240 Hz before
anything stops it, and what is small and fast is through. Its own remedy (CCD) ignores that the ground moves. Here the
part of a body's velocity that closes the gap is scaled for one step so that it just arrives, and given back after it:
the solver then meets the collision at the surface and at the true speed. A body that is deep in the ground all the
same (spawned there, or the ground jumped) would be thrown out in proportion; its speed is capped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.config import SELECTION
from smartmesh_ros.patches.selection import window_memory
from smartmesh_ros.patches.selector import rules_for
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.impact import TOUCH, clamp_before_impact
from smartmesh_ros.terrain.grid import BoolArray, FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap

if TYPE_CHECKING:
    from smartmesh_ros.physics.ground import Ground


@dataclass(frozen=True, kw_only=True)
class LandingConfig:
    """When bodies are clamped before impact.

    ``arrival``: bodies arrive so deep in the ground, as a share of the tolerance, that the next step finds them in
    contact with a collider that lies within this share of where it should be; twice as deep each time that it does not
    meet it. ``shallow`` [m], ``falling``: what would come no deeper is left to the solver, nor what would come no
    deeper than so many times a fall from rest for a step: all that lies on the ground would. ``near``: bodies within
    this share of their radius of coming as near to the ground as they move in a step are looked at closely. ``deep``
    [m], ``escape`` [m/s]: a body deeper than this leaves the ground no faster than that.
    """

    arrival: float = 0.5
    shallow: float = 5e-4
    falling: float = 1.25
    near: float = 0.5
    deep: float = 0.01
    escape: float = 1.0


LANDING = LandingConfig()
# A body that has not met its collider after so many doublings of the arrival's depth meets nothing.
MOST_TRIES = 6
NO_NORMALS = np.empty((0, 3))


class Escape(NamedTuple):
    """A body deep in the ground, the ground's upward normal (3,) and velocity (3,) [m/s] there, and its velocity before
    the step (3,) [m/s]."""

    uid: int
    normal: FloatArray
    ground: FloatArray
    before: FloatArray


class Clamped(NamedTuple):
    """What was done before a step and is to be undone after it: followers that were slowed, their bodies, the
    velocities taken from them (n, 3) [m/s]; and bodies deep in the ground."""

    followers: list[int]
    uids: list[int]
    taken: FloatArray
    escapes: list[Escape]


class Landing:
    """Clamps the velocities of the bodies on one `Ground`."""

    def __init__(self, client: Any, ground: Ground) -> None:
        self._client = client
        self._calls = BulletCalls(client)
        self._ground = ground
        self._memory = window_memory(SELECTION.most_samples + 3)
        self.tries: dict[Follower, int] = {}  # in how many steps in a row each was clamped

    def clamp(self, free: BoolArray, time: float, physics: PhysicsConfig) -> Clamped | None:
        """Has bodies arrive at the ground's surface in the coming step; ``free`` (N,): which followers may be slowed.
        None where there is nothing to undo."""
        ground, dt = self._ground, physics.dt
        fall = np.array(physics.gravity) * dt
        shallow = max(LANDING.shallow, LANDING.falling * math.hypot(*physics.gravity) * dt * dt)
        codes = np.zeros(len(ground.followers), np.int64)
        found = approaching(
            ground.positions_w, ground.moved_w, ground.states, ground.supports, ground.shapes, free, time - ground.time,
            dt, fall, shallow, LANDING.near, LANDING.deep, codes,
        )  # fmt: skip
        tries, self.tries = self.tries, {}
        if not found:
            return None
        escapes = [self._escape(index) for index in np.flatnonzero(codes == DEEP).tolist()]
        near = np.flatnonzero(codes == APPROACHING).tolist()
        followers, changes = self._changes(near, tries, time, dt, fall, shallow)
        clamped = [ground.followers[index] for index in followers]
        self.tries = {follower: tries.get(follower, 0) + 1 for follower in clamped}
        uids = [follower.body for follower in clamped]
        self._calls.add_velocities(uids, changes.tolist())
        return Clamped(followers, uids, -changes, escapes)

    def restore(self, clamped: Clamped, physics: PhysicsConfig) -> None:
        """Gives bodies their velocity back after the step, and has those deep in the ground leave it slowly."""
        followers, uids, taken, escapes = clamped
        if uids:
            given_back = np.array(self._calls.add_velocities(uids, taken.tolist()))
            self._ground.will_move(followers, given_back * physics.dt)
        for escape in escapes:
            self._hold_back(escape)

    def _changes(
        self, near: list[int], tries: dict[Follower, int], time: float, dt: float, fall: FloatArray, shallow: float
    ) -> tuple[list[int], FloatArray]:
        """Which followers are slowed, and by how much (n, 3) [m/s]."""
        ground = self._ground
        rules = rules_for(ground.config, SELECTION, 0.0, across=False)
        found, changes, change = [], [], np.empty(3)
        tiles = list(ground.terrain.tiles.values())
        arrival = LANDING.arrival * ground.config.tolerance
        for index in near:
            mesh, follower = tiles[int(ground.supports["tile"][index])], ground.followers[index]
            if not isinstance(mesh, HeightMap):
                continue
            body = self._calls.states([follower.body])[0]
            deeper = arrival * 2 ** min(tries.get(follower, 0), MOST_TRIES)
            given = (mesh.moved_to(time), ground.shapes[index : index + 1], body, time, dt, fall, shallow, deeper)
            memory = (rules, *self._memory[:2], change)
            clamps = clamp_one(*given, NO_NORMALS, *memory)
            if clamps and len(touching := self._touching(follower)):
                clamps = clamp_one(*given, touching, *memory)
            if clamps:
                found.append(index)
                changes.append(change.copy())
        return found, np.array(changes).reshape(-1, 3)

    def _touching(self, follower: Follower) -> FloatArray:
        """Unit normals (n, 3), towards a follower, of the points where it touches its collider now.

        PyBullet is asked: a body at rest lies on its collider, which may be off the ground by the tolerance.
        """
        points = chain.from_iterable(
            self._client.getClosestPoints(follower.body, collider, TOUCH)
            for collider in self._ground.colliders_of(follower)
        )
        return np.array([point[7] for point in points]).reshape(-1, 3)

    def _escape(self, index: int) -> Escape:
        support, uid = self._ground.supports[index], self._ground.followers[index].body
        normal = np.array([support.facet_x, support.facet_y, support.facet_z])
        velocity = np.array([support.slide_x, support.slide_y, support.rise])
        return Escape(uid, normal, velocity, np.array(self._client.getBaseVelocity(uid)[0]))

    def _hold_back(self, escape: Escape) -> None:
        """Caps the speed, away from the ground, of a body that leaves it, but not below what it had before."""
        linear, angular = self._client.getBaseVelocity(escape.uid)
        speed = float((np.array(linear) - escape.ground) @ escape.normal)
        most = max(LANDING.escape, float((escape.before - escape.ground) @ escape.normal))
        if speed > most:
            slower = np.array(linear) + (most - speed) * escape.normal
            self._client.resetBaseVelocity(escape.uid, slower.tolist(), angular)


# What `approaching` says of a follower, beside zero: it may meet the ground in this step, or is deep in it.
APPROACHING, DEEP = 1, 2


@compiled
def approaching(positions, moved, states, supports, shapes, free, age, dt, fall, shallow, near, deep, codes):
    """Which bodies may meet the ground in the coming step, or are deep in it, by the plane of the ground nearest to
    them at the last update, ``age`` [s] ago; how many. ``positions``, ``moved`` (N, 3) [m], ``states`` (N, 13)."""
    count = 0
    for i in range(len(positions)):
        support = supports[i]
        if not free[i] or support.state == Support.NONE or support.state == Support.MESH:
            continue
        nx, ny, nz = support.normal_x, support.normal_y, support.normal_z
        went = (
            nx * (positions[i, 0] - states[i, 0] - support.slide_x * age)
            + ny * (positions[i, 1] - states[i, 1] - support.slide_y * age)
            + nz * (positions[i, 2] - states[i, 2] - support.rise * age)
        )
        gap = support.gap + went
        x = moved[i, 0] + (fall[0] - support.slide_x) * dt
        y = moved[i, 1] + (fall[1] - support.slide_y) * dt
        z = moved[i, 2] + (fall[2] - support.rise) * dt
        closing = -(nx * x + ny * y + nz * z)
        length = math.sqrt(x * x + y * y + z * z)
        if gap < -deep and support.gap < -deep:
            codes[i] = DEEP
            count += 1
        elif (closing > shallow or length > near * shapes[i].radius) and gap - length < near * shapes[i].radius:
            codes[i] = APPROACHING
            count += 1
    return count


@compiled
def clamp_one(
    grid, shape, body, time, dt, fall, least, arrival, normals, rules, memory_h, memory_r, change
):  # fmt: skip
    """`clamp_before_impact` for a record in an array of one."""
    return clamp_before_impact(
        grid, shape[0], body, time, dt, fall, least, arrival, normals, rules, memory_h, memory_r, change
    )  # fmt: skip
