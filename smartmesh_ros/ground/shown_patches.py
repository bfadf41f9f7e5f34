"""Patches under attached bodies: chosen when they are asked for, by messages or by colliders of PyBullet's own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.ground.selector import Selector
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.terrain import Terrain

# Largest gap at which a body at rest touches its ground [m].
TOUCHING = 1e-3


class ShownPatches:
    """The patches of all followers as of the last update."""

    def __init__(self, terrain: Terrain, config: PatchConfig, followers: Followers, stopwatch: Stopwatch) -> None:
        self.stopwatch = stopwatch
        self._followers = followers
        self._selector = Selector(terrain, config, stopwatch)
        followers.tables.append(self._selector)
        self._time = 0.0  # of the update [s]
        self._duration = 0.0  # until the next one [s]
        self._fall = 0.0  # in that time [m]
        self._chosen = self._tracked_chosen = True

    def configure(self, config: PatchConfig) -> None:
        """Replace the settings from the next update on."""
        self._selector.configure(config)

    def begin(self, time: float, duration: float, fall: float) -> None:
        """Forget the choice: the next reader chooses patches at ``time`` [s] for a ``duration`` [s], in which bodies
        ``fall`` [m]. Ground that a body cannot come to in that time is not chosen."""
        self._time, self._duration, self._fall = time, duration, fall
        self._chosen = self._tracked_chosen = False

    @property
    def supports(self) -> Any:
        """Supports by slot: records of ``SUPPORT`` (S,)."""
        self._choose()
        return self._selector.supports

    @property
    def batches(self) -> list[PatchBatch]:
        """The patches; their bodies are slots. Bodies without colliders have none before `choose_tracked`."""
        self._choose()
        return self._selector.batches()

    def choose_tracked(self) -> None:
        """Choose the patches of the bodies that were attached with ``solid=False``."""
        self._choose()
        if not self._tracked_chosen:
            self._tracked_chosen = True
            self._select(self._followers.tracked)

    def _choose(self) -> None:
        if self._chosen:
            return
        self._chosen = True
        self._select(self._followers.solid)
        if self._fall < math.inf:
            self._let_go(self._followers.solid)

    def _select(self, slots: IntArray) -> None:
        followers = self._followers
        self._selector.update(slots, followers.shape_table, followers.states, self._time, self._duration)

    def _let_go(self, slots: IntArray) -> None:
        """Discard ground that bodies cannot come to until the next update."""
        states, radii, found = (
            self._followers.states[slots],
            self._followers.radii[slots],
            self._selector.supports[slots],
        )
        ground = np.stack([found["slide_x"], found["slide_y"], found["rise"]], axis=1)
        speeds = np.linalg.norm(states[:, 7:10] - ground, axis=1) + radii * np.linalg.norm(states[:, 10:], axis=1)
        self._selector.let_go(slots, speeds * self._duration + self._fall + TOUCHING)
