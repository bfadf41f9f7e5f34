"""Supports of all bodies on a terrain of one or more tiles, updated as bodies and ground move."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from smartmesh_ros.patches.batch import MeshPatch, PatchBatch, grid_batches, mesh_batch
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.shapes import ShapeTable
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.patches.supports import Support, no_supports
from smartmesh_ros.report.fixed import FixedPatches
from smartmesh_ros.report.mesh import MeshPatches
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

# Largest speed that sizes patches [m/s], because a teleported body has no real speed.
FASTEST = 50.0


class Selector:
    """Chooses a support for each body, by the report's methods. Bodies are addressed by slot.

    ``supports`` (S,): records of ``SUPPORT`` as of the last update, NONE for unused slots.
    """

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch | None = None) -> None:
        self.terrain = terrain
        self.config = config
        self.stopwatch = stopwatch or Stopwatch()
        self.supports = no_supports(0)
        self.mesh_patches: dict[int, MeshPatch] = {}
        self._time = 0.0
        self._layout = -1
        self._fixed = FixedPatches(terrain, self.stopwatch)
        self._meshes: dict[str, MeshPatches] = {}
        self._batches: list[PatchBatch] | None = None

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self.supports = with_rows(self.supports, slots, no_supports(1)[0])
        self._fixed.grow(slots)

    def configure(self, config: PatchConfig) -> None:
        """Replace the settings; the next update chooses every support anew."""
        self.config = config
        self.supports["state"] = Support.NONE
        self._fixed.forget(slice(None))

    def clear(self, slot: int) -> None:
        """Discard all data of a slot, whose body was removed."""
        self.supports[slot] = no_supports(1)[0]
        self.mesh_patches.pop(slot, None)
        self._fixed.forget(np.array([slot]))
        self._batches = None

    def update(self, chosen: IntArray, shapes: ShapeTable, bodies: FloatArray, time: float, duration: float) -> None:
        """Choose the supports of the bodies in the slots ``chosen`` (n,) for the ``duration`` [s] from ``time`` [s] on.

        ``shapes`` and ``bodies`` (S, 13): of all slots. The supports of other bodies stay as they are.
        """
        before = self.batches() if self.config.search == "ray_cast" else []
        self._update_tiles()
        self._time, self._batches = time, None
        radii = shapes.table["radius"]
        for name, found in self._on_tiles(chosen, bodies, radii):
            mesh = self.terrain.tiles[name]
            speeds = np.minimum(np.linalg.norm(bodies[found, 7:10], axis=1), FASTEST)
            reach = radii[found] + speeds * duration
            if isinstance(mesh, HeightMap):
                self._fixed.select(
                    mesh, found, shapes, bodies, reach, time, duration, self.config, self.supports, before
                )
            else:
                self.mesh_patches |= self._meshes[name].select(
                    found, shapes, bodies, reach, time, duration, self.config, self.supports, self.mesh_patches
                )

    def let_go(self, chosen: IntArray, moved: FloatArray) -> None:
        """Discard the supports of the bodies in ``chosen`` (n,) that are farther from their ground than they have
        ``moved`` (n,) [m]."""
        self.supports["state"][chosen[self.supports["gap"][chosen] > moved]] = Support.NONE
        self._batches = None

    def batches(self) -> list[PatchBatch]:
        """Return the patches of all bodies as of the last update."""
        if self._batches is None:
            self._update_tiles()
            self._batches = list(self._all_batches())
        return self._batches

    def _all_batches(self) -> Iterator[PatchBatch]:
        supports = self.supports
        for name in self.terrain.tiles:
            chosen = np.flatnonzero(
                (supports["tile"] == self.terrain.numbers[name]) & (supports["state"] != Support.NONE)
            )
            if not chosen.size:
                continue
            if name in self._meshes:
                for body in chosen.tolist():
                    yield mesh_batch(name, body, self.supports[body : body + 1], self.mesh_patches[body], self.config)
            else:
                yield from grid_batches(self.terrain, name, chosen, self.supports[chosen], self._time, self.config)

    def _update_tiles(self) -> None:
        """Handle tiles that were added, removed or replaced."""
        if self._layout == self.terrain.layout_revision:
            return
        meshes = {}
        for name, mesh in self.terrain.tiles.items():
            if not isinstance(mesh, HeightMap):
                old = self._meshes.get(name)
                meshes[name] = old if old is not None and old.mesh is mesh else MeshPatches(mesh, self.stopwatch)
        self._meshes = meshes
        self._fixed.forget(slice(None))
        self._layout = self.terrain.layout_revision

    def _on_tiles(self, chosen: IntArray, states: FloatArray, radii: FloatArray) -> list[tuple[str, IntArray]]:
        """Group bodies by the names of their tiles. A body stays on its tile while it is above it; else it moves to the
        first tile below it, or to the nearest one within its reach."""
        supports, tiles, names = self.supports, self.terrain.tiles, list(self.terrain.tiles)
        there = np.isfinite(states[chosen]).all(axis=1)
        supports["state"][chosen[~there]] = Support.NONE
        chosen = chosen[there]
        if not (tiles and chosen.size):
            supports["state"][chosen] = Support.NONE
            return []
        positions, columns = states[chosen], np.arange(len(chosen))
        numbers = np.array([self.terrain.numbers[name] for name in names] + [-1])
        beyond = np.array([mesh.beyond(positions) for mesh in tiles.values()])
        now = (supports["tile"][chosen] == numbers[:-1, None]).argmax(axis=0)  # places in ``names``
        stray = (numbers[now] != supports["tile"][chosen]) | (beyond[now, columns] > 0.0)
        # A body further from a tile than its radius cannot touch it, but a gap of one cell between tiles is ground.
        least = np.maximum(radii[chosen], self.terrain.widest_cell if len(tiles) > 1 else 0.0)
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
