"""Wakes bodies that PyBullet has put to sleep, after the ground under them has changed.

A body sleeps only if its user has enabled sleeping. PyBullet wakes it when another body hits it, but not when its
collider moves or is removed. PyBullet does not report which bodies sleep, but a sleeping body's velocity is exactly
zero. An awake body on changed ground has a velocity after one step, so a body with zero velocity at the update after
the change is asleep. Awake bodies are never woken, because the call would enable sleeping for a rigid body that has it
disabled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.patches.carry_over import carried_over
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray


class Waking:
    """Marks bodies whose ground has changed, by index, until the next update shows whether they sleep."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._changed = np.empty(0, bool)

    def adopt(self, kept: IntArray) -> None:
        """Replace the list of attached bodies; ``kept`` (N,): each one's previous index, -1 = new."""
        self._changed = carried_over(self._changed, kept, np.zeros(len(kept), bool))

    def note(self, changed: BoolArray) -> None:
        """Mark the bodies (N,) whose collider was changed, moved, added or removed."""
        self._changed |= changed

    def wake(self, followers: list[Follower], states: FloatArray) -> None:
        """Wake the marked bodies that have not moved since; ``states`` (N, 13). Call it after at least one step."""
        noted = np.flatnonzero(self._changed)
        if not noted.size:
            return
        self._changed[noted] = False
        for index in noted[~states[noted, 7:13].any(axis=1)].tolist():
            self._client.changeDynamics(followers[index].body, -1, activationState=pb.ACTIVATION_STATE_WAKE_UP)
