"""Patches under attached bodies by the report's methods, for colliders of PyBullet's own."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh
from studies.report.config import ReportConfig, is_whole
from studies.report.map_patches import MapPatches, PatchBatch
from studies.report.mesh_patches import MeshPatches

# Largest speed that sizes patches [m/s], because a teleported body has no real speed.
FASTEST = 50.0


class ChosenPatches:
    """The patches of the followers on a main mesh, as of the last refresh: ``batches``."""

    def __init__(self, mesh: MainMesh, config: ReportConfig, followers: Followers) -> None:
        self.batches: list[PatchBatch] = []
        self._config, self._followers = config, followers
        self.take(mesh)

    def take(self, mesh: MainMesh) -> None:
        """Choose patches on another main mesh from now on."""
        self._mesh = mesh
        self._patches: MapPatches | MeshPatches
        if isinstance(mesh, HeightMap):
            self._patches = MapPatches(mesh, self._config)
        else:
            self._patches = MeshPatches(mesh, self._config)

    def refresh(self, time: float, duration: float, states: FloatArray) -> None:
        """Choose the patches of the bodies, with ``states`` (S, 13) by slot, at ``time`` [s] for a ``duration`` [s];
        none if bodies stand on one collider of the whole mesh. Those are left out that are nowhere, or so far beside
        the mesh that they do not touch it."""
        self._patches.grow(len(states))
        self.batches = []
        radii, slots = self._followers.radii, np.flatnonzero(self._followers.table["alive"])
        slots = slots[np.isfinite(states[slots]).all(axis=1)]
        slots = slots[self._mesh.beyond(states[slots]) <= radii[slots]]
        if slots.size and not is_whole(self._config.kind):
            speeds = np.minimum(np.linalg.norm(states[slots, 7:10], axis=1), FASTEST)
            reach = radii[slots] + speeds * duration
            self.batches = list(self._patches.around(slots, states[slots], reach, time, duration))
