"""Clamps bodies before impact: a body that would penetrate the ground within a step arrives at its surface instead.

PyBullet detects a collision only once bodies overlap. At 240 Hz a body falling at 8 m/s is 33 mm deep in the ground
before a contact stops it, and a small fast body passes through. PyBullet's own remedy (CCD) ignores that the ground
moves. Here the component of a body's velocity that closes the gap is scaled for one step, so that the body just
arrives, and is restored after the step. The solver then handles the collision at the surface and at the true speed.

A body that is deep in the ground nevertheless (spawned there, or the ground jumped) would be ejected at a speed
proportional to its depth; its speed is capped.
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
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.followers import Follower
from smartmesh_ros.physics.impact import TOUCH, clamp_before_impact
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

if TYPE_CHECKING:
    from smartmesh_ros.physics.ground import Ground


@dataclass(frozen=True, kw_only=True)
class LandingConfig:
    """When bodies are clamped before impact.

    ``arrival``: penetration at which a clamped body arrives, as a share of the tolerance. The next step then finds the
    body in contact with a collider whose error is below this share; the penetration doubles each time the body misses
    its collider. ``shallow`` [m], ``falling``: impacts shallower than ``shallow``, or than ``falling`` * g * dt^2, are
    left to the solver. A body resting on the ground reaches g * dt^2 in every step. ``near``: a body is checked exactly
    if its gap, less its motion in the step, is below this share of its radius. ``deep`` [m], ``escape`` [m/s]: a body
    deeper than ``deep`` leaves the ground at most at the speed ``escape``.
    """

    arrival: float = 0.5
    shallow: float = 5e-4
    falling: float = 1.25
    near: float = 0.5
    deep: float = 0.01
    escape: float = 1.0


LANDING = LandingConfig()
# Largest number of doublings of the arrival depth.
MOST_TRIES = 6
NO_CONTACTS = np.empty((0, 4))


class Escape(NamedTuple):
    """A body deep in the ground; the ground's upward normal (3,) and velocity (3,) [m/s] at the body; and the body's
    velocity before the step (3,) [m/s]."""

    uid: int
    normal: FloatArray
    ground: FloatArray
    before: FloatArray


class Clamped(NamedTuple):
    """Changes of one step that are undone after it: slots of clamped followers, their bodies, the velocities
    subtracted from them (n, 3) [m/s]; and bodies deep in the ground."""

    slots: list[int]
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
        # Number of successive steps in which each follower was clamped and touched nothing, by slot.
        self.tries: IntArray = np.empty(0, np.int64)

    def reserve(self, slots: int) -> None:
        """Make room for bodies in ``slots`` slots."""
        self.tries = with_rows(self.tries, slots, 0)

    def forget(self, slot: int) -> None:
        """Discard the data of a slot, whose body was removed."""
        self.tries[slot] = 0

    def clamp(self, time: float, physics: PhysicsConfig) -> Clamped | None:
        """Clamp bodies that would penetrate the ground in the coming step. Returns the changes to undo, None if there
        are none."""
        ground, dt = self._ground, physics.dt
        followers = ground.followers
        if not followers.free.size:
            return None
        fall = np.array(physics.gravity) * dt
        shallow = max(LANDING.shallow, LANDING.falling * math.hypot(*physics.gravity) * dt * dt)
        codes = np.zeros(followers.capacity, np.int64)
        found = approaching(
            followers.free, followers.positions_w, followers.moved_w, followers.states, ground.supports,
            followers.shapes, time - ground.time, dt, fall, shallow, LANDING.near, LANDING.deep, codes,
        )  # fmt: skip
        if not found:
            self.tries[:] = 0
            return None
        tries = self.tries.copy()
        self.tries[:] = 0
        escapes = [self._escape(slot) for slot in np.flatnonzero(codes == DEEP).tolist()]
        near = np.flatnonzero(codes == APPROACHING).tolist()
        slots, changes = self._changes(near, tries, time, dt, fall, shallow)
        uids = [followers[slot].body for slot in slots]
        self._calls.add_velocities(uids, changes.tolist())
        return Clamped(slots, uids, -changes, escapes)

    def restore(self, clamped: Clamped, physics: PhysicsConfig) -> None:
        """Restore the velocities of clamped bodies after the step, and cap the speed of bodies that leave the ground
        from deep in it."""
        slots, uids, taken, escapes = clamped
        if uids:
            given_back = np.array(self._calls.add_velocities(uids, taken.tolist()))
            self._ground.will_move(slots, given_back * physics.dt)
        for escape in escapes:
            self._hold_back(escape)

    def _changes(
        self, near: list[int], tries: IntArray, time: float, dt: float, fall: FloatArray, shallow: float
    ) -> tuple[list[int], FloatArray]:
        """Return the slots of the followers to clamp, and the changes of their velocities (n, 3) [m/s]."""
        ground = self._ground
        rules = rules_for(ground.config, SELECTION, 0.0, across=False)
        found, changes, change = [], [], np.empty(3)
        arrival = LANDING.arrival * ground.config.tolerance
        for slot in near:
            mesh, follower = ground.terrain.numbered(int(ground.supports["tile"][slot])), ground.followers[slot]
            if not isinstance(mesh, HeightMap):
                continue
            body = self._calls.states([follower.body])[0]
            deeper = arrival * 2 ** min(int(tries[slot]), MOST_TRIES)
            given = (mesh.moved_to(time), ground.followers.shapes, slot, body, time, dt, fall, shallow, deeper)
            memory = (rules, *self._memory[:2], change)
            if not clamp_before_impact(*given, NO_CONTACTS, *memory):
                continue
            touching = self._touching(follower, body, dt)
            if len(touching) == 0:
                self.tries[slot] = tries[slot] + 1
            elif not clamp_before_impact(*given, touching, *memory):
                continue
            found.append(slot)
            changes.append(change.copy())
        return found, np.array(changes).reshape(-1, 3)

    def _touching(self, follower: Follower, body: FloatArray, dt: float) -> FloatArray:
        """Return the current contacts of a follower, a ``body`` (13,), with its collider, as `without_closing` takes
        them (n, 4).

        The contacts are queried from PyBullet, because a body at rest lies on its collider, which may differ from the
        ground by the tolerance.
        """
        found = [
            self._client.getClosestPoints(follower.body, collider, TOUCH)
            for collider in self._ground.colliders_of(follower)
        ]
        points, normals = (np.array([p[i] for p in chain(*found)]).reshape(-1, 3) for i in (5, 7))
        turning = np.cross(body[10:], points - body[:3]) * dt
        return np.column_stack([normals, (normals * turning).sum(axis=1)])

    def _escape(self, slot: int) -> Escape:
        support, uid = self._ground.supports[slot], self._ground.followers[slot].body
        normal = np.array([support.facet_x, support.facet_y, support.facet_z])
        velocity = np.array([support.slide_x, support.slide_y, support.rise])
        return Escape(uid, normal, velocity, np.array(self._client.getBaseVelocity(uid)[0]))

    def _hold_back(self, escape: Escape) -> None:
        """Cap the speed at which a body leaves the ground, but not below its speed before the step."""
        linear, angular = self._client.getBaseVelocity(escape.uid)
        speed = float((np.array(linear) - escape.ground) @ escape.normal)
        most = max(LANDING.escape, float((escape.before - escape.ground) @ escape.normal))
        if speed > most:
            slower = np.array(linear) + (most - speed) * escape.normal
            self._client.resetBaseVelocity(escape.uid, slower.tolist(), angular)


# Codes of `approaching`, zero = neither: a body that may meet the ground in this step, or one that is deep in it.
APPROACHING, DEEP = 1, 2


@compiled
def approaching(chosen, positions, moved, states, supports, shapes, age, dt, fall, shallow, near, deep, codes):
    """Write to ``codes`` (S,) which bodies in the slots ``chosen`` (n,) may meet the ground in the coming step, or are
    deep in it; returns their number.

    The test uses the plane of the ground nearest to each body at the last update, ``age`` [s] ago. ``positions``,
    ``moved`` (S, 3) [m], ``states`` (S, 13).
    """
    count = 0
    for k in range(len(chosen)):
        i = chosen[k]
        support = supports[i]
        if support.state == Support.NONE or support.state == Support.MESH:
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
        close = near * shapes.table[i].radius
        if gap < -deep and support.gap < -deep:
            codes[i] = DEEP
            count += 1
        elif (closing > shallow or length > close) and gap - length < close:
            codes[i] = APPROACHING
            count += 1
    return count
