"""The supports of all bodies on a terrain of one or several tiles, kept up with the bodies and the ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import (
    MeshPatch,
    PatchBatch,
    grid_batches,
    mesh_batch,
    rectangle_samples,
    samples_across,
)
from smartmesh_ros.patches.carry_over import carried_over
from smartmesh_ros.patches.config import SELECTION, PatchConfig, SelectionConfig
from smartmesh_ros.patches.report.fixed import FixedPatches
from smartmesh_ros.patches.report.mesh import MeshPatches
from smartmesh_ros.patches.selection import Place, Rules, select, select_across, window_memory, window_of
from smartmesh_ros.patches.shapes import BODY_COLUMNS, SHAPE
from smartmesh_ros.patches.supports import Support, no_supports
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

NO_SAMPLES = np.empty(0)


def rules_for(config: PatchConfig, more: SelectionConfig, gravity: float, *, across: bool) -> Rules:
    """The settings as compiled functions take them."""
    return Rules(
        config.tolerance, more.hysteresis, more.leave, config.kind != "heightfield", config.kind == "plane",
        config.kind == "heightfield", more.most_cells, more.most_samples, more.fastest, gravity, across,
    )  # fmt: skip


class Selector:
    """Supports by the bodies' indices, as of the last update.

    ``supports`` (N,): records of ``SUPPORT``; ``samples``: heights [m] of those fields that are not read from one map,
    each from its record's ``first`` on. Bodies that are not ``solid`` get patches of fixed extent, once asked for.
    """

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch | None = None) -> None:
        self.terrain = terrain
        self.config = config
        self.stopwatch = stopwatch or Stopwatch()
        self.supports = no_supports(0)
        self._plain = self.supports.view(np.ndarray)  # the same table, whose columns are read faster
        self.samples = NO_SAMPLES
        self.mesh_patches: dict[int, MeshPatch] = {}
        self.gravity = 9.81  # [m/s^2]
        self._shapes = np.zeros(0, SHAPE).view(np.recarray)
        self._solid = np.empty(0, bool)
        self._everybody = np.empty(0, np.int64)  # solid bodies
        self._only_grid: HeightMap | None = None  # the one tile, if it is a height map
        self._bodies, self._time, self._duration = np.empty((0, BODY_COLUMNS)), 0.0, 1.0
        self._layout = -1
        self._names: list[str] = []
        self._fixed = FixedPatches(terrain, self.stopwatch)
        self._meshes: dict[str, MeshPatches] = {}
        self._memory = window_memory(SELECTION.most_samples + 3)
        self._batches: list[PatchBatch] | None = None
        self._parts: list[FloatArray] = []  # of the samples
        self._count = 0  # of all of them
        self._tracked_due = False

    def adopt(self, shapes: Any, solid: BoolArray, kept: IntArray) -> None:
        """Says which bodies there are: their ``shapes`` (N,), which are ``solid`` (N,), and each one's index before,
        -1 = new (N,)."""
        self._shapes, self._solid = shapes, solid
        self._everybody = np.flatnonzero(solid)
        self.supports = carried_over(self.supports, kept, no_supports(len(kept)))
        self._plain = self.supports.view(np.ndarray)
        places = {int(old): new for new, old in enumerate(kept.tolist()) if old >= 0}
        self.mesh_patches = {places[old]: patch for old, patch in self.mesh_patches.items() if old in places}
        self._bodies = carried_over(self._bodies, kept, np.full((len(kept), BODY_COLUMNS), np.nan))
        self._fixed.adopt(kept)
        for mesh in self._meshes.values():
            mesh.adopt(kept)
        self._batches = None

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings; bodies are chosen for anew."""
        self.config = config
        self.forget(slice(None))

    @property
    def names(self) -> list[str]:
        """The tiles, by the index that supports know them by."""
        return self._names

    def forget(self, bodies: IntArray | slice) -> None:
        """Has bodies chosen for as if they were new."""
        self.supports["state"][bodies] = Support.NONE
        self._fixed.forget(bodies)

    def update(self, bodies: FloatArray, time: float, duration: float) -> None:
        """Chooses the supports of ``bodies`` (N, 13) for the ``duration`` [s] from ``time`` [s] on."""
        if self._layout != self.terrain.layout_revision:
            self._take_tiles()
        before = self.batches() if self.config.search == "ray_cast" else []
        self._bodies, self._time, self._duration, self._batches = bodies, time, duration, None
        self._tracked_due = len(self._everybody) < len(bodies)
        self._parts, self._count = [], 0
        if self._only_grid is not None and self.config.chooses:  # off the map nothing is touchable
            self._choose_on_grid(self._only_grid, 0, self._everybody)
        else:
            self._choose(self._everybody, before)
        self.samples = np.concatenate(self._parts) if self._parts else NO_SAMPLES

    def batches(self) -> list[PatchBatch]:
        """Patches of all bodies as of the last update."""
        if self._batches is None:
            if self._layout != self.terrain.layout_revision:
                self._take_tiles()
            if self._tracked_due:
                self._tracked_due = False
                self._choose_fixed(np.flatnonzero(~self._solid), [])
            self._batches = list(self._all_batches())
        return self._batches

    def _all_batches(self) -> Iterator[PatchBatch]:
        for index, name in enumerate(self._names):
            if name not in self.terrain.tiles:
                continue
            chosen = np.flatnonzero((self._plain["tile"] == index) & (self._plain["state"] != Support.NONE))
            if not chosen.size:
                continue
            if name in self._meshes:
                for body in chosen.tolist():
                    yield mesh_batch(name, body, self.supports[body : body + 1], self.mesh_patches[body], self.config)
            else:
                yield from grid_batches(self.terrain, name, chosen, self.supports[chosen], self._time, self.config)

    def _choose(self, chosen: IntArray, before: list[PatchBatch]) -> None:
        """Chooses for solid bodies."""
        if not self.config.chooses:
            self._choose_fixed(chosen, before)
            return
        for name, bodies in self._on_tiles(chosen):
            mesh = self.terrain.tiles[name]
            if isinstance(mesh, HeightMap):
                self._choose_on_grid(mesh, self._names.index(name), bodies)
            else:
                self._choose_on_mesh(name, bodies, fixed=False)

    def _choose_on_grid(self, heightmap: HeightMap, tile: int, bodies: IntArray) -> None:
        """Gives bodies what they can touch of a height map."""
        across = len(self._names) > 1
        rules = rules_for(self.config, SELECTION, self.gravity, across=across)
        grid = heightmap.moved_to(self._time)
        with self.stopwatch.stage("search"):
            select(
                grid, tile, self._shapes, self._bodies, bodies, self._duration, self._time, rules, self.supports,
                *self._memory,
            )  # fmt: skip
            if across:
                for body in bodies[self._plain["state"][bodies] == Support.ACROSS].tolist():
                    self._choose_across(heightmap, grid, body, rules)

    def _choose_across(self, heightmap: HeightMap, grid: Any, body: int, rules: Rules) -> None:
        """Chooses for a body whose window reaches over the edge of its tile."""
        one, support = self._shapes[body : body + 1], self.supports[body : body + 1]
        place = window_of(grid, one, self._bodies[body], self._duration, rules)
        r, c = np.divmod(np.arange(place.high * place.wide), place.wide)
        rows, columns = place.row + r[None] * place.stride, place.column + c[None] * place.stride
        samples = samples_across(self.terrain, heightmap, rows, columns, self._time, self._duration)
        shape = (place.high, place.wide)
        rises = (samples.velocities * self._duration).reshape(shape)
        support["state"] = Support.FIELD
        select_across(
            grid, Place(*place), samples.heights.reshape(shape), rises, one, self._bodies[body], self._duration, rules,
            support, self._memory[2],
        )  # fmt: skip
        if support["state"][0] == Support.FIELD:
            self._add_samples(body, self._rectangle_heights(heightmap, body))

    def _rectangle_heights(self, heightmap: HeightMap, body: int) -> FloatArray:
        rows, columns = rectangle_samples(self.supports[body : body + 1])
        heights: FloatArray = samples_across(self.terrain, heightmap, rows, columns, self._time).heights[0]
        return heights

    def _add_samples(self, body: int, heights: FloatArray) -> None:
        """Keeps the heights (K,) [m] of a field that is not read from one map."""
        self._plain["first"][body] = self._count
        self._count += len(heights)
        self._parts.append(heights)

    def _choose_fixed(self, chosen: IntArray, before: list[PatchBatch]) -> None:
        """Gives bodies patches of fixed extent."""
        for name, bodies in self._on_tiles(chosen):
            mesh = self.terrain.tiles[name]
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
        """Gives bodies patches of a general mesh; ``fixed``: also those that cannot touch it."""
        self.mesh_patches |= self._meshes[name].select(
            chosen, self._shapes, self._bodies, self._reach(chosen), self._time, self._duration, self.config,
            self.supports, self.mesh_patches, self.gravity, fixed=fixed,
        )  # fmt: skip

    def _reach(self, chosen: IntArray) -> FloatArray:
        """How far from where they are bodies get, by their velocity (n,) [m]."""
        speeds = np.linalg.norm(self._bodies[chosen, 7:10], axis=1)
        return np.asarray(self._shapes["radius"][chosen] + np.minimum(speeds, SELECTION.fastest) * self._duration)

    def _take_tiles(self) -> None:
        """Notices tiles that came, went or were replaced; bodies on them look for their tile anew."""
        names = list(self.terrain.tiles)
        known = dict.fromkeys(names)
        places = np.array([names.index(name) if name in known else -1 for name in self._names] + [-1])
        self.supports["tile"] = places[self.supports["tile"]]
        meshes = {}
        for name, mesh in self.terrain.tiles.items():
            if not isinstance(mesh, HeightMap):
                old = self._meshes.get(name)
                meshes[name] = old if old is not None and old.mesh is mesh else MeshPatches(mesh, self.stopwatch)
                if meshes[name] is not old:
                    meshes[name].adopt(np.full(len(self._shapes), -1))
        self._meshes, self._names = meshes, names
        tiles = list(self.terrain.tiles.values())
        self._only_grid = tiles[0] if len(tiles) == 1 and isinstance(tiles[0], HeightMap) else None
        self._fixed.forget(slice(None))
        self._layout = self.terrain.layout_revision

    def _on_tiles(self, chosen: IntArray) -> list[tuple[str, IntArray]]:
        """Bodies by the tile they are on: they stay on theirs as long as they are over it, else they go to the first
        that they are over, or the one that they reach most nearly."""
        tiles, supports = self._plain["tile"], self._plain
        there = np.isfinite(self._bodies[chosen]).all(axis=1)
        supports["state"][chosen[~there]] = Support.NONE
        chosen = chosen[there]
        supports["first"][chosen] = -1
        if not (self._names and chosen.size):
            supports["state"][chosen] = Support.NONE
            return []
        positions = self._bodies[chosen]
        beyond = np.array([self.terrain.tiles[name].beyond(positions) for name in self._names])
        stray = tiles[chosen] < 0
        columns = np.arange(len(chosen))
        stray |= beyond[np.maximum(tiles[chosen], 0), columns] > 0.0
        # A body beyond its reach touches nothing, but in a gap of a cell between tiles there is ground.
        least = np.maximum(self._shapes["radius"][chosen], self.terrain.widest_cell if len(self._names) > 1 else 0.0)
        over = np.where(beyond <= 0.0, 0.0, beyond)
        nearest = over.argmin(axis=0)
        nearest[over[nearest, columns] > least] = -1
        found = np.where(stray, nearest, tiles[chosen])
        moved = chosen[found != tiles[chosen]]
        if moved.size:
            self._fixed.forget(moved)
        tiles[chosen] = found
        supports["state"][chosen[found < 0]] = Support.NONE
        return [(self._names[index], chosen[found == index]) for index in np.unique(found[found >= 0]).tolist()]
