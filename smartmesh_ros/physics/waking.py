"""Wakes bodies that PyBullet has put to sleep, after the ground under them has changed.

A body falls asleep only if its user has enabled it. PyBullet wakes it when another body hits it, but not when the
collider under it moves or goes. Which bodies sleep cannot be read; but their velocities are exactly zero. An awake body
on changed ground has a velocity after one step, so a body that has none at the update after the change is asleep. No
other body is told to wake, because that would allow a rigid body to sleep whose sleeping is disabled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.patches.carry_over import carried_over
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray


class Waking:
    """Remembers whose ground has changed, by the follower's index, until the next update tells whether it sleeps."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._changed = np.empty(0, bool)

    def adopt(self, kept: IntArray) -> None:
        """Takes other followers; ``kept`` (N,): each one's index before, -1 = new."""
        self._changed = carried_over(self._changed, kept, np.zeros(len(kept), bool))

    def note(self, changed: BoolArray) -> None:
        """Notes the followers (N,) whose collider was changed, moved, given or taken away."""
        self._changed |= changed

    def wake(self, followers: list[Follower], states: FloatArray) -> None:
        """Wakes the noted bodies that have not moved since; ``states`` (N, 13). Call it after at least one step."""
        noted = np.flatnonzero(self._changed)
        if not noted.size:
            return
        self._changed[noted] = False
        for index in noted[~states[noted, 7:13].any(axis=1)].tolist():
            self._client.changeDynamics(followers[index].body, -1, activationState=pb.ACTIVATION_STATE_WAKE_UP)
