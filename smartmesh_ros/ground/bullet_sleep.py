"""PyBullet's own sleep: stops single bodies, tells whether they may be stopped, and notices that they moved."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import IntArray

# A sleeping multibody wakes by itself if its joints' motors move it in the last steps before it stands still.
_SLEEP = pb.ACTIVATION_STATE_ENABLE_SLEEPING | pb.ACTIVATION_STATE_SLEEP | pb.ACTIVATION_STATE_DISABLE_WAKEUP
# A rigid body heeds the second call alone, a robot both; neither then sleeps by PyBullet's own rule.
_WAKE = (
    pb.ACTIVATION_STATE_WAKE_UP | pb.ACTIVATION_STATE_ENABLE_WAKEUP,
    pb.ACTIVATION_STATE_DISABLE_SLEEPING,
)
# Steps until a multibody stands still after `stop`. It still falls freely in them if nothing holds it.
STEPS_TO_STOP = 2
# Joints of one degree of freedom, whose velocities `freeze` sets to zero.
_SINGLE = (pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC)
_REST = (0.0, 0.0, 0.0)
# Largest motion of a sleeping body that is rounding [m].
ROUNDING = 1e-6


class SleepContacts(NamedTuple):
    """Contact points of a body with its ``collider``, a PyBullet body, as PyBullet reported them before the body fell
    asleep. PyBullet then no longer reports them."""

    collider: int | None
    points: list[Any]


class BulletSleep:
    """Stops and starts the bodies of one client, and reads those that sleep in turn, because their user may move them
    through PyBullet, or PyBullet wake them. Followers are addressed by slot."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._client = client
        self._calls = BulletCalls(client)
        self._followers = followers
        self._next = 0  # place in the sleeping bodies of the next one to read
        self._fresh: IntArray = np.empty(0, np.int64)  # fell asleep, and are read in the next update

    def stop(self, body: int) -> None:
        """Put a body to sleep; it stands still after `STEPS_TO_STOP` steps, until `start`, unless an awake body touches
        it."""
        self._client.changeDynamics(body, -1, activationState=_SLEEP)

    def start(self, body: int) -> None:
        """Wake a body."""
        for state in _WAKE:
            self._client.changeDynamics(body, -1, activationState=state)

    def freeze(self, body: int) -> None:
        """Set the velocities of a body that stands still to zero. A step of gravity is left in those of a robot."""
        client = self._client
        client.resetBaseVelocity(body, _REST, _REST)
        for joint in self._joints(body):
            client.resetJointState(body, joint, client.getJointState(body, joint)[0], 0.0)

    def lift(self, body: int, by: float) -> None:
        """Move a body up by some metres."""
        (x, y, z), orientation = self._client.getBasePositionAndOrientation(body)
        self._client.resetBasePositionAndOrientation(body, (x, y, z + by), orientation)

    def joints_rest(self, body: int, fastest: float) -> bool:
        """Return True if no joint of a body is faster than ``fastest`` [rad/s, m/s]."""
        return all(abs(self._client.getJointState(body, joint)[1]) <= fastest for joint in self._joints(body))

    def supported(self, body: int) -> bool:
        """Return True if a body cannot fall: it lies on something, or its base is fixed."""
        if is_fixed(self._client, body):
            return True
        points = self._client.getContactPoints(body)
        return any(point[1] != point[2] and point[9] > 0.0 for point in points)

    def contacts_before_sleep(self, slots: IntArray) -> dict[int, SleepContacts]:
        """Return the contacts of followers (n,) with their colliders in the last step, by slot."""
        colliders = {slot: self._followers[slot].collider for slot in slots.tolist()}
        slot_of = {collider: slot for slot, collider in colliders.items() if collider is not None}
        contacts = {slot: SleepContacts(collider, []) for collider, slot in slot_of.items()}
        # All points are read, because PyBullet swaps the bodies of a point to fit a filter, but not its friction.
        for point in self._client.getContactPoints():
            slot = slot_of.get(point[1], slot_of.get(point[2]))
            if slot is not None:
                contacts[slot].points.append(point)
        return contacts

    def watch(self, slots: IntArray) -> None:
        """Note bodies that fell asleep; all are read in the next update."""
        self._fresh = slots

    def moved(self, duration: float, period: float) -> IntArray:
        """Return the slots of those that are not where they fell asleep, among the bodies that fell asleep in the last
        update, and as many others as are due in a ``duration`` [s] if each is read once in a ``period`` [s]."""
        asleep = self._followers.asleep
        if not asleep.size:
            return asleep
        count = min(math.ceil(len(asleep) * duration / period), len(asleep))
        due = asleep[np.arange(self._next, self._next + count) % len(asleep)]
        self._next = (self._next + count) % len(asleep)
        chosen = np.concatenate([np.intersect1d(self._fresh, asleep), due])
        self._fresh = chosen[:0]
        return np.array([slot for slot in chosen.tolist() if self._moved(slot)], np.int64)

    def _moved(self, slot: int) -> bool:
        follower, known = self._followers[slot], self._followers.states[slot]
        found = self._calls.state(follower.body, follower.link)
        return not CORE.strayed(found, known, follower.radius) <= ROUNDING  # True for NaN

    def _joints(self, body: int) -> list[int]:
        """Return the joints of one degree of freedom."""
        client = self._client
        return [j for j in range(client.getNumJoints(body)) if client.getJointInfo(body, j)[2] in _SINGLE]


def is_fixed(client: Any, body: int) -> bool:
    """Return True if the base of a body has no mass, so that physics does not move it."""
    return float(client.getDynamicsInfo(body, -1)[0]) == 0.0
