"""Supports of all bodies on a terrain of one or more tiles, updated as bodies and ground move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.patches.batch import (
    MeshPatch,
    PatchBatch,
    grid_batches,
    mesh_batch,
    rectangle_samples,
    samples_across,
)
from smartmesh_ros.patches.config import SELECTION, PatchConfig, SelectionConfig
from smartmesh_ros.patches.report.fixed import FixedPatches
from smartmesh_ros.patches.report.mesh import MeshPatches
from smartmesh_ros.patches.selection import Place, Rules, select, select_across, window_memory, window_of
from smartmesh_ros.patches.shapes import BODY_COLUMNS, Shapes, ShapeTable
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.patches.supports import Support, no_supports
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain

NO_SAMPLES = np.empty(0)


def rules_for(config: PatchConfig, more: SelectionConfig, gravity: float, *, across: bool) -> Rules:
    """Return both configs as one record for compiled functions."""
    return Rules(
        config.tolerance, more.hysteresis, more.leave, config.kind != "heightfield", config.kind == "plane",
        config.kind == "heightfield", more.most_cells, more.most_samples, more.fastest, gravity, across,
    )  # fmt: skip


class _Tile(NamedTuple):
    """A tile of the terrain, with its number in the supports."""

    name: str
    number: int
    mesh: MainMesh


class Selector:
    """Chooses a support for each body. Bodies are addressed by slot.

    ``supports`` (S,): records of ``SUPPORT`` as of the last update, NONE for unused slots. ``samples``: heights [m] of
    the fields that cannot be read from a single map; a support's ``first`` is the index of its first height.
    """

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch | None = None) -> None:
        self.terrain = terrain
        self.config = config
        self.stopwatch = stopwatch or Stopwatch()
        self.supports = no_supports(0)
        self.samples = NO_SAMPLES
        self.mesh_patches: dict[int, MeshPatch] = {}
        self._shapes = ShapeTable().shapes
        self._bodies, self._time, self._duration = np.empty((0, BODY_COLUMNS)), 0.0, 1.0
        self._gravity = 9.81  # [m/s^2]
        self._layout = -1
        self._tiles: list[_Tile] = []
        self._only_grid: HeightMap | None = None  # the one tile, if it is a height map
        self._fixed = FixedPatches(terrain, self.stopwatch)
        self._meshes: dict[str, MeshPatches] = {}
        self._memory = window_memory(SELECTION.most_samples + 3)
        self._batches: list[PatchBatch] | None = None
        self._parts: list[FloatArray] = []  # of `samples`, one for each field
        self._count = 0  # heights in `_parts`

    def reserve(self, slots: int) -> None:
        """Make room for bodies in ``slots`` slots."""
        self.supports = with_rows(self.supports, slots, no_supports(1)[0])
        self._fixed.reserve(slots)
        for mesh in self._meshes.values():
            mesh.reserve(slots)

    def configure(self, config: PatchConfig) -> None:
        """Replace the settings; the next update chooses every support anew."""
        self.config = config
        self.forget(slice(None))

    def forget(self, bodies: IntArray | slice) -> None:
        """Discard the supports of ``bodies``; the next update treats these bodies as new."""
        self.supports["state"][bodies] = Support.NONE
        self._fixed.forget(bodies)

    def remove(self, slot: int) -> None:
        """Discard all data of a slot, whose body was removed."""
        self.supports[slot] = no_supports(1)[0]
        self.mesh_patches.pop(slot, None)
        self._fixed.forget(np.array([slot]))
        for mesh in self._meshes.values():
            mesh.forget(np.array([slot]))
        self._batches = None

    def update(
        self, chosen: IntArray, shapes: Shapes, bodies: FloatArray, time: float, duration: float, gravity: float
    ) -> None:
        """Choose the supports of the bodies in the slots ``chosen`` (n,) for the ``duration`` [s] from ``time`` [s] on.

        ``shapes`` and ``bodies`` (S, 13): of all slots. ``gravity`` [m/s^2]: predicts falling.
        The supports of other bodies stay as they are.
        """
        before = self.batches() if self.config.search == "ray_cast" else []
        if self._layout != self.terrain.layout_revision:
            self._update_tiles()
        self._shapes, self._bodies, self._time, self._duration, self._gravity = shapes, bodies, time, duration, gravity
        self._batches = None
        self._parts, self._count = [], 0
        if self._only_grid is not None and self.config.chooses:  # beyond the map's edge no ground is in reach
            self._choose_on_grid(self._only_grid, self._tiles[0].number, chosen)
        else:
            self._choose(chosen, before)
        self.samples = np.concatenate(self._parts) if self._parts else NO_SAMPLES

    def choose_tracked(self, chosen: IntArray) -> None:
        """Select patches of fixed extent for bodies in the slots ``chosen`` (n,), which have no colliders, at the time
        of the last update."""
        if self._layout != self.terrain.layout_revision:
            self._update_tiles()
        self._choose_fixed(chosen, [])
        self._batches = None

    def batches(self) -> list[PatchBatch]:
        """Return the patches of all bodies as of the last update."""
        if self._batches is None:
            if self._layout != self.terrain.layout_revision:
                self._update_tiles()
            self._batches = list(self._all_batches())
        return self._batches

    def _all_batches(self) -> Iterator[PatchBatch]:
        supports = self.supports
        for name, number, _ in self._tiles:
            if name not in self.terrain.tiles:
                continue
            chosen = np.flatnonzero((supports["tile"] == number) & (supports["state"] != Support.NONE))
            if not chosen.size:
                continue
            if name in self._meshes:
                for body in chosen.tolist():
                    yield mesh_batch(name, body, self.supports[body : body + 1], self.mesh_patches[body], self.config)
            else:
                yield from grid_batches(self.terrain, name, chosen, self.supports[chosen], self._time, self.config)

    def _choose(self, chosen: IntArray, before: list[PatchBatch]) -> None:
        """Choose supports for solid bodies."""
        if not self.config.chooses:
            self._choose_fixed(chosen, before)
            return
        for (name, number, mesh), bodies in self._on_tiles(chosen):
            if isinstance(mesh, HeightMap):
                self._choose_on_grid(mesh, number, bodies)
            else:
                self._choose_on_mesh(name, bodies, fixed=False)

    def _choose_on_grid(self, heightmap: HeightMap, tile: int, bodies: IntArray) -> None:
        """Choose the ground that bodies can touch on a height map."""
        across = len(self._tiles) > 1
        rules = rules_for(self.config, SELECTION, self._gravity, across=across)
        grid = heightmap.moved_to(self._time)
        with self.stopwatch.stage("search"):
            select(
                grid, tile, self._shapes, self._bodies, bodies, self._duration, self._time, rules, self.supports,
                *self._memory,
            )  # fmt: skip
            if across:
                for body in bodies[self.supports["state"][bodies] == Support.ACROSS].tolist():
                    self._choose_across(heightmap, grid, body, rules)

    def _choose_across(self, heightmap: HeightMap, grid: Any, body: int, rules: Rules) -> None:
        """Choose the support of a body whose window extends beyond the edge of its tile."""
        shapes, support = self._shapes, self.supports[body : body + 1]
        place = window_of(grid, shapes, body, self._bodies[body], self._duration, rules)
        r, c = np.divmod(np.arange(place.high * place.wide), place.wide)
        rows, columns = place.row + r[None] * place.stride, place.column + c[None] * place.stride
        samples = samples_across(self.terrain, heightmap, rows, columns, self._time, self._duration)
        shape = (place.high, place.wide)
        rises = (samples.velocities * self._duration).reshape(shape)
        support["state"] = Support.FIELD
        select_across(
            grid, Place(*place), samples.heights.reshape(shape), rises, shapes, body, self._bodies[body],
            self._duration, rules, support, self._memory[2],
        )  # fmt: skip
        if support["state"][0] == Support.FIELD:
            self._add_samples(body, self._rectangle_heights(heightmap, body))

    def _rectangle_heights(self, heightmap: HeightMap, body: int) -> FloatArray:
        rows, columns = rectangle_samples(self.supports[body : body + 1])
        heights: FloatArray = samples_across(self.terrain, heightmap, rows, columns, self._time).heights[0]
        return heights

    def _add_samples(self, body: int, heights: FloatArray) -> None:
        """Store the heights (K,) [m] of a field that cannot be read from a single map."""
        self.supports["first"][body] = self._count
        self._count += len(heights)
        self._parts.append(heights)

    def _choose_fixed(self, chosen: IntArray, before: list[PatchBatch]) -> None:
        """Select patches of fixed extent for bodies."""
        for (name, _, mesh), bodies in self._on_tiles(chosen):
            if isinstance(mesh, HeightMap):
                heights = self._fixed.select(
                    mesh, bodies, self._shapes, self._bodies, self._reach(bodies), self._time, self._duration,
                    self.config, self.supports, before,
                )  # fmt: skip
                for body, values in zip(bodies.tolist(), heights, strict=True):
                    self._add_samples(body, values)
            else:
                self._choose_on_mesh(name, bodies, fixed=True)

    def _choose_on_mesh(self, name: str, chosen: IntArray, *, fixed: bool) -> None:
        """Select patches of a general mesh for bodies; ``fixed``: include bodies that cannot touch the mesh."""
        self.mesh_patches |= self._meshes[name].select(
            chosen, self._shapes, self._bodies, self._reach(chosen), self._time, self._duration, self.config,
            self.supports, self.mesh_patches, self._gravity, fixed=fixed,
        )  # fmt: skip

    def _reach(self, chosen: IntArray) -> FloatArray:
        """Return the radius within which each body can touch ground until the next update, from its speed (n,) [m]."""
        speeds = np.linalg.norm(self._bodies[chosen, 7:10], axis=1)
        return np.asarray(self._shapes.table["radius"][chosen] + np.minimum(speeds, SELECTION.fastest) * self._duration)

    def _update_tiles(self) -> None:
        """Handle tiles that were added, removed or replaced."""
        meshes = {}
        for name, mesh in self.terrain.tiles.items():
            if not isinstance(mesh, HeightMap):
                old = self._meshes.get(name)
                meshes[name] = old if old is not None and old.mesh is mesh else MeshPatches(mesh, self.stopwatch)
                meshes[name].reserve(len(self.supports))
        self._meshes = meshes
        numbers = self.terrain.numbers
        self._tiles = [_Tile(name, numbers[name], mesh) for name, mesh in self.terrain.tiles.items()]
        first = self._tiles[0].mesh if len(self._tiles) == 1 else None
        self._only_grid = first if isinstance(first, HeightMap) else None
        self._fixed.forget(slice(None))
        self._layout = self.terrain.layout_revision

    def _on_tiles(self, chosen: IntArray) -> list[tuple[_Tile, IntArray]]:
        """Group bodies by tile. A body stays on its tile while it is above it; otherwise it moves to the first tile
        below it, or to the nearest one within its reach."""
        supports = self.supports
        there = np.isfinite(self._bodies[chosen]).all(axis=1)
        supports["state"][chosen[~there]] = Support.NONE
        chosen = chosen[there]
        supports["first"][chosen] = -1
        if not (self._tiles and chosen.size):
            supports["state"][chosen] = Support.NONE
            return []
        positions, columns = self._bodies[chosen], np.arange(len(chosen))
        numbers = np.array([tile.number for tile in self._tiles] + [-1])
        beyond = np.array([tile.mesh.beyond(positions) for tile in self._tiles])
        now = (supports["tile"][chosen] == numbers[:-1, None]).argmax(axis=0)  # places in `_tiles`
        stray = (numbers[now] != supports["tile"][chosen]) | (beyond[now, columns] > 0.0)
        # A body further from a tile than its radius cannot touch it, but a gap of one cell between tiles is ground.
        least = np.maximum(
            self._shapes.table["radius"][chosen], self.terrain.widest_cell if len(self._tiles) > 1 else 0.0
        )
        over = np.where(beyond <= 0.0, 0.0, beyond)
        nearest = over.argmin(axis=0)
        nearest[over[nearest, columns] > least] = -1
        found = np.where(stray, nearest, now)
        moved = chosen[numbers[found] != supports["tile"][chosen]]
        if moved.size:
            self._fixed.forget(moved)
        supports["tile"][chosen] = numbers[found]
        supports["state"][chosen[found < 0]] = Support.NONE
        return [(self._tiles[place], chosen[found == place]) for place in np.unique(found[found >= 0]).tolist()]
