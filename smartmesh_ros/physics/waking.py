"""Wakes bodies that PyBullet has put to sleep, after the ground under them has changed.

A body sleeps only if its user has enabled sleeping. PyBullet wakes it when another body hits it, but not when its
collider moves or is removed. PyBullet does not report which bodies sleep, but a sleeping body's velocity is exactly
zero. An awake body on changed ground has a velocity after one step, so a body with zero velocity at the update after
the change is asleep. Awake bodies are never woken, because the call would enable sleeping for a rigid body that has it
disabled.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.physics.followers import Followers
from smartmesh_ros.terrain.grid import BoolArray


class Waking:
    """Marks bodies whose ground has changed, by slot, until the next update shows whether they sleep."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._changed: BoolArray = np.empty(0, bool)

    def reserve(self, slots: int) -> None:
        """Make room for bodies in ``slots`` slots."""
        self._changed = with_rows(self._changed, slots, False)

    def forget(self, slot: int) -> None:
        """Discard the mark of a slot, whose body was removed."""
        self._changed[slot] = False

    def note(self, changed: BoolArray) -> None:
        """Mark the bodies (S,) whose collider was changed, moved, added or removed."""
        self._changed |= changed

    def wake(self, followers: Followers, stopped: Collection[int] = ()) -> None:
        """Wake the marked bodies that have not moved since, but for the PyBullet bodies ``stopped`` on purpose. Call it
        after at least one step, with their new states."""
        noted = np.flatnonzero(self._changed)
        if not noted.size:
            return
        self._changed[noted] = False
        for slot in noted[~followers.states[noted, 7:13].any(axis=1)].tolist():
            if followers[slot].body not in stopped:
                self._client.changeDynamics(followers[slot].body, -1, activationState=pb.ACTIVATION_STATE_WAKE_UP)
