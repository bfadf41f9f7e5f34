"""Patches under attached bodies by the report's methods, for colliders of PyBullet's own."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.patches.shapes import BODY_COLUMNS
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh
from studies.report.batch import PatchBatch
from studies.report.config import ReportConfig, is_whole
from studies.report.map_patches import MapPatches
from studies.report.mesh_patches import MeshPatches

# Largest speed that sizes patches [m/s], because a teleported body has no real speed.
FASTEST = 50.0


class ChosenPatches:
    """The patches of the followers on a main mesh, as of the last refresh: ``batches``."""

    def __init__(self, mesh: MainMesh, config: ReportConfig, followers: Followers) -> None:
        self.batches: list[PatchBatch] = []
        self._config, self._followers = config, followers
        self._time = self._duration = 0.0  # of the refresh, and until the next one [s]
        self._tracked = True  # whether the patches of the tracked bodies are there
        self._states = np.empty((0, BODY_COLUMNS))  # of the refresh
        self.take(mesh)

    def take(self, mesh: MainMesh) -> None:
        """Choose patches on another main mesh from now on."""
        self._mesh = mesh
        self._patches: MapPatches | MeshPatches
        if isinstance(mesh, HeightMap):
            self._patches = MapPatches(mesh, self._config)
        else:
            self._patches = MeshPatches(mesh, self._config)
        self._patches.grow(len(self._states))

    def clear(self, slot: int) -> None:
        """Discard what is known of a slot, whose body was removed."""
        if slot < len(self._states):  # else it was added since the refresh
            self._patches.clear(slot)

    def refresh(self, time: float, duration: float, states: FloatArray) -> None:
        """Choose the patches of the solid bodies, with ``states`` (S, 13) by slot, at ``time`` [s] for a ``duration``
        [s]; none if bodies stand on one collider of the whole mesh."""
        self._states = states
        self._patches.grow(len(states))
        self._time, self._duration, self._tracked = time, duration, False
        self.batches = [] if is_whole(self._config.kind) else self._chosen(self._followers.solid)

    def choose_tracked(self) -> None:
        """Choose the patches of the bodies that were attached with ``solid=False``."""
        if not self._tracked:
            self._tracked = True
            self.batches += self._chosen(self._followers.tracked)

    def _chosen(self, slots: IntArray) -> list[PatchBatch]:
        """Return the patches of the bodies in ``slots`` (n,) that are somewhere, over the mesh or so near to it that
        they touch it."""
        states, radii = self._states, self._followers.shape_table.table["radius"]
        slots = slots[np.isfinite(states[slots]).all(axis=1)]
        slots = slots[self._mesh.beyond(states[slots]) <= radii[slots]]
        if not slots.size:
            return []
        speeds = np.minimum(np.linalg.norm(states[slots, 7:10], axis=1), FASTEST)
        reach = radii[slots] + speeds * self._duration
        return list(self._patches.around(slots, states[slots], reach, self._time, self._duration))
