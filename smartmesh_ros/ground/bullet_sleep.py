"""PyBullet's own sleep: stops single bodies, and tells whether they may be stopped."""

from __future__ import annotations

from typing import Any

import pybullet as pb

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


class BulletSleep:
    """Stops and starts the bodies of one client."""

    def __init__(self, client: Any) -> None:
        self._client = client

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

    def _joints(self, body: int) -> list[int]:
        """Return the joints of one degree of freedom."""
        client = self._client
        return [j for j in range(client.getNumJoints(body)) if client.getJointInfo(body, j)[2] in _SINGLE]


def is_fixed(client: Any, body: int) -> bool:
    """Return True if the base of a body has no mass, so that physics does not move it."""
    return float(client.getDynamicsInfo(body, -1)[0]) == 0.0
