"""Patches under attached bodies by the report's methods, for colliders of PyBullet's own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.patches.shapes import BODY_COLUMNS
from smartmesh_ros.patches.tables import with_rows
from smartmesh_ros.report.batch import PatchBatch, grid_batches
from smartmesh_ros.report.config import ReportConfig
from smartmesh_ros.report.fixed import FixedPatches
from smartmesh_ros.report.mesh import MeshPatches
from smartmesh_ros.report.supports import Support, no_supports
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

# Largest speed that sizes patches [m/s], because a teleported body has no real speed.
FASTEST = 50.0


class ChosenPatches:
    """The patches of all followers as of the last update, by the report's methods. Bodies are addressed by slot."""

    def __init__(self, terrain: Terrain, config: ReportConfig, followers: Followers, stopwatch: Stopwatch) -> None:
        self.stopwatch = stopwatch
        self._terrain = terrain
        self._config = config
        self._followers = followers
        self._supports = no_supports(0)  # as of the last choice, NONE for unused slots
        self._mesh_patches: dict[int, PatchBatch] = {}
        self._fixed = FixedPatches(terrain, stopwatch)
        self._meshes: dict[str, MeshPatches] = {}
        self._layout = -1
        self._batches: list[PatchBatch] | None = None
        self._time, self._states = 0.0, np.empty((0, BODY_COLUMNS))  # of the update [s]
        self._duration = 0.0  # until the next one [s]
        self._chosen = self._tracked_chosen = True

    def clear(self, slot: int) -> None:
        """Discard all data of a slot, whose body was removed."""
        if slot >= len(self._supports):  # added since the last update
            return
        self._supports[slot] = no_supports(1)[0]
        self._mesh_patches.pop(slot, None)
        self._fixed.forget(np.array([slot]))
        self._batches = None

    def begin(self, time: float, duration: float, states: FloatArray) -> None:
        """Forget the choice: the next reader chooses patches at ``time`` [s] for a ``duration`` [s], of bodies with
        ``states`` (S, 13)."""
        self._time, self._duration, self._states = time, duration, states
        self._supports = with_rows(self._supports, len(states), no_supports(1)[0])
        self._fixed.grow(len(states))
        self._chosen = self._tracked_chosen = False

    @property
    def supports(self) -> Any:
        """Supports by slot: records of ``SUPPORT`` (S,)."""
        self._choose()
        return self._supports

    @property
    def batches(self) -> list[PatchBatch]:
        """The patches; their bodies are slots. Bodies without colliders have none before `choose_tracked`."""
        self._choose()
        return self._known_batches()

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

    def _select(self, chosen: IntArray) -> None:
        """Choose the supports of the bodies in the slots ``chosen`` (n,). Those of other bodies stay as they are."""
        before = self._known_batches() if self._config.search == "ray_cast" else []
        self._update_tiles()
        self._batches = None
        bodies, radii, duration = self._states, self._followers.shape_table.table["radius"], self._duration
        for name, found in self._on_tiles(chosen, bodies, radii):
            mesh = self._terrain.tiles[name]
            speeds = np.minimum(np.linalg.norm(bodies[found, 7:10], axis=1), FASTEST)
            reach = radii[found] + speeds * duration
            if isinstance(mesh, HeightMap):
                self._fixed.select(
                    mesh, found, bodies, reach, self._time, duration, self._config, self._supports, before
                )
            else:
                self._mesh_patches |= self._meshes[name].select(
                    found, bodies, reach, self._time, duration, self._config, self._supports,
                    self._mesh_patches,
                )  # fmt: skip

    def _known_batches(self) -> list[PatchBatch]:
        if self._batches is None:
            self._update_tiles()
            self._batches = list(self._all_batches())
        return self._batches

    def _all_batches(self) -> Iterator[PatchBatch]:
        supports = self._supports
        for name in self._terrain.tiles:
            chosen = np.flatnonzero(
                (supports["tile"] == self._terrain.numbers[name]) & (supports["state"] != Support.NONE)
            )
            if not chosen.size:
                continue
            if name in self._meshes:
                yield from (self._mesh_patches[body] for body in chosen.tolist())
            else:
                yield from grid_batches(self._terrain, name, chosen, supports[chosen], self._time, self._config)

    def _update_tiles(self) -> None:
        """Handle tiles that were added, removed or replaced."""
        if self._layout == self._terrain.layout_revision:
            return
        meshes = {}
        for name, mesh in self._terrain.tiles.items():
            if not isinstance(mesh, HeightMap):
                old = self._meshes.get(name)
                meshes[name] = old if old is not None and old.mesh is mesh else MeshPatches(name, mesh, self.stopwatch)
        self._meshes = meshes
        self._fixed.forget(slice(None))
        self._layout = self._terrain.layout_revision

    def _on_tiles(self, chosen: IntArray, states: FloatArray, radii: FloatArray) -> list[tuple[str, IntArray]]:
        """Group bodies by the names of their tiles. A body stays on its tile while it is above it; else it moves to the
        first tile below it, or to the nearest one within its reach."""
        supports, tiles, names = self._supports, self._terrain.tiles, list(self._terrain.tiles)
        there = np.isfinite(states[chosen]).all(axis=1)
        supports["state"][chosen[~there]] = Support.NONE
        chosen = chosen[there]
        if not (tiles and chosen.size):
            supports["state"][chosen] = Support.NONE
            return []
        positions, columns = states[chosen], np.arange(len(chosen))
        numbers = np.array([self._terrain.numbers[name] for name in names] + [-1])
        beyond = np.array([mesh.beyond(positions) for mesh in tiles.values()])
        now = (supports["tile"][chosen] == numbers[:-1, None]).argmax(axis=0)  # places in ``names``
        stray = (numbers[now] != supports["tile"][chosen]) | (beyond[now, columns] > 0.0)
        # A body further from a tile than its radius cannot touch it, but a gap of one cell between tiles is ground.
        least = np.maximum(radii[chosen], self._terrain.widest_cell if len(tiles) > 1 else 0.0)
        over = np.where(beyond <= 0.0, 0.0, beyond)
        nearest = over.argmin(axis=0)
        nearest[over[nearest, columns] > least] = -1
        found = np.where(stray, nearest, now)
        moved = chosen[numbers[found] != supports["tile"][chosen]]
        if moved.size:
            self._fixed.forget(moved)
        supports["tile"][chosen] = numbers[found]
        supports["state"][chosen[found < 0]] = Support.NONE
        return [(names[place], chosen[found == place]) for place in np.unique(found[found >= 0]).tolist()]
