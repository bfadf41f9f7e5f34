"""One patch under each body, kept up with the bodies and the ground."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.grid_patches import GridPatches
from smartmesh_ros.patches.mesh_patches import MeshPatches
from smartmesh_ros.patches.moving import Moving
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain


class PatchTracker:
    """Knows on which tile each body stands, and has its patch made there."""

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch | None = None) -> None:
        self.terrain = terrain
        self.config = config
        self.stopwatch = stopwatch or Stopwatch()
        self.of_solid: list[PatchBatch] = []  # as of the last update
        self._late: list[PatchBatch] = []  # of the others, as last worked out
        self._waiting: list[tuple[str, Moving]] = []  # tiles, and the others on them
        self._time, self._dt, self._lively = 0.0, 0.0, False
        self._radii = np.empty(0)
        self._solid = np.empty(0, bool)
        self._tile = np.empty(0, np.int64)  # place of the body's tile in _names, -1 = none
        self._names: list[str] = []
        self._meshes: dict[str, MainMesh] = {}
        self._grid = GridPatches(terrain, config, self.stopwatch)
        self._general: dict[str, MeshPatches] = {}

    def set_bodies(self, radii: FloatArray, kept: IntArray, solid: BoolArray | None = None) -> None:
        """Says which bodies there are: bounding ``radii`` (N,) [m]; per body, its index before or -1 (N,); which are
        ``solid`` (N,), that is, need no more ground than they can touch. The others always get a patch."""
        self._radii = np.asarray(radii, np.float64)
        self._solid = np.ones(len(self._radii), bool) if solid is None else solid
        carry_over(self, {"_tile": -1}, kept)
        self._grid.set_bodies(kept)
        for general in self._general.values():
            general.set_bodies(kept)
        self.of_solid, self._late, self._waiting = [], [], []

    @property
    def batches(self) -> list[PatchBatch]:
        """Patches of all bodies as of the last update. Those of bodies that are not solid, which nothing else needs,
        are worked out when they are first asked for."""
        waiting, self._waiting = self._waiting, []
        if waiting:
            before, self._late = self._late, []
            for name, moving in waiting:
                if self.terrain.tiles.get(name) is self._meshes[name]:
                    self._late += self._patches(name, moving, before, solid=False)
        return self.of_solid + self._late

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings, from the next update on."""
        self.config = config
        self._grid.configure(config)
        for general in self._general.values():
            general.config = config

    def update(
        self, positions_w: FloatArray, moved_w: FloatArray, time: float, dt: float, *, lively: bool = False
    ) -> list[PatchBatch]:
        """Patches at ``time`` [s] for solid bodies among those at ``positions_w`` (N, 3) [m] that may move on by
        ``moved_w`` (N, 3) [m] in the step of ``dt`` [s] until the next update. Bodies off the terrain, or whose
        position is not finite, get none. ``lively``: colliders do not last from one step to the next."""
        if self.terrain.tiles != self._meshes:
            self._take_tiles()
        before, self.of_solid, self._waiting = self.of_solid, [], []
        self._time, self._dt, self._lively = time, dt, lively
        if not (len(positions_w) and self._names):
            self._late = []
            return self.of_solid
        everybody = bool(self._solid.all())
        for place, bodies, grid in self._on_tiles(positions_w):
            name = self._names[place]
            moving = Moving(bodies, grid, positions_w[bodies], self._radii[bodies], moved_w[bodies])
            if not everybody:
                solid = self._solid[bodies]
                if not solid.all():
                    self._waiting.append((name, moving.of(~solid)))
                    moving = moving.of(solid)
            if moving.bodies.size:
                self.of_solid += self._patches(name, moving, before, solid=True)
        if not self._waiting:
            self._late = []
        return self.of_solid

    def _patches(self, name: str, moving: Moving, before: list[PatchBatch], *, solid: bool) -> list[PatchBatch]:
        """Patches of bodies on a tile; only those of ``solid`` ones are chosen."""
        time = self._time
        if not isinstance(self._meshes[name], HeightMap):
            return self._general[name].patches(name, moving.bodies, moving.positions_w, moving.reach, time, before)
        if solid:
            return self._grid.patches(name, moving, time, self._dt, before, lively=self._lively)
        return self._grid.of_fixed_extent(name, moving, time, before, solid=False)

    def _take_tiles(self) -> None:
        """Notices tiles that came, went or were replaced; bodies on them look for their tile anew."""
        names = list(self.terrain.tiles)
        same = [name for name in names if self._meshes.get(name) is self.terrain.tiles[name]]
        places = np.full(len(self._names) + 1, -1)
        for place, name in enumerate(self._names):
            if name in same:
                places[place] = names.index(name)
        self._tile = places[self._tile]
        self._grid.forget(np.flatnonzero(self._tile < 0))
        self._names, self._meshes = names, dict(self.terrain.tiles)
        everybody = np.full(len(self._radii), -1)
        kept = {name: self._general[name] for name in same if name in self._general}
        for name, mesh in self._meshes.items():
            if name not in kept and not isinstance(mesh, HeightMap):
                kept[name] = MeshPatches(mesh, self.config, self.stopwatch)
                kept[name].set_bodies(everybody)
        self._general = kept

    def _on_tiles(self, positions_w: FloatArray) -> list[tuple[int, IntArray, FloatArray]]:
        """Bodies by tile: the place of the tile, indices (n,), and their fractional (row, column) (n, 2)."""
        found = []
        if len(self._names) == 1:
            mesh = self._meshes[self._names[0]]
            beyond, grid = mesh.beyond(positions_w)
            inside = (beyond <= self._radii) & np.isfinite(positions_w[:, 2])
            if inside.all():
                return [(0, np.arange(len(positions_w)), grid)]
            bodies = np.flatnonzero(inside)
            return [(0, bodies, grid[bodies])] if bodies.size else []
        stray = self._tile < 0
        for place in np.unique(self._tile[~stray]).tolist():
            bodies = np.flatnonzero(self._tile == place)
            beyond, grid = self._meshes[self._names[place]].beyond(positions_w[bodies])
            inside = (beyond <= 0.0) & np.isfinite(positions_w[bodies, 2])
            stray[bodies[~inside]] = True
            if inside.any():
                found.append((place, bodies[inside], grid[inside]))
        if stray.any():
            found += self._settle(np.flatnonzero(stray), positions_w)
        return found

    def _settle(self, stray: IntArray, positions_w: FloatArray) -> list[tuple[int, IntArray, FloatArray]]:
        """Finds the tile of bodies that left theirs: the first they are on, or else the one they reach most nearly."""
        # A body beyond its radius touches nothing, but in a gap of a cell between tiles there is ground.
        least = np.maximum(self._radii[stray], self.terrain.widest_cell)
        least[~np.isfinite(positions_w[stray]).all(axis=1)] = -1.0
        chosen = np.full(len(stray), -1)
        grids = np.zeros((len(stray), 2))
        for place, name in enumerate(self._names):
            beyond, grid = self._meshes[name].beyond(positions_w[stray])
            nearer = (beyond <= least) & ((chosen < 0) | (beyond < least))
            chosen[nearer], least[nearer] = place, beyond[nearer]
            if grid.size:  # a general mesh has no rows and columns
                grids[nearer] = grid[nearer]
        self._grid.forget(stray[chosen != self._tile[stray]])
        self._tile[stray] = chosen
        return [
            (place, stray[chosen == place], grids[chosen == place]) for place in np.unique(chosen[chosen >= 0]).tolist()
        ]
