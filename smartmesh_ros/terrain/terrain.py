"""Everything the bodies stand on: one height map, or several tiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples
from smartmesh_ros.terrain.revisions import next_revision
from smartmesh_ros.terrain.scrolling import correct_across
from smartmesh_ros.terrain.trimesh import TriangleMesh

MainMesh = HeightMap | TriangleMesh


class Terrain:
    """Main meshes by name: tiles that are height maps or general meshes. A single one is called ``""``."""

    def __init__(self, single: MainMesh | None = None) -> None:
        self.tiles: dict[str, MainMesh] = {}
        self.layout_revision = next_revision()  # changes when a tile comes, goes or is replaced by another
        if single is not None:
            self.put("", single)

    @classmethod
    def of(cls, ground: MainMesh | Terrain) -> Terrain:
        """``ground`` itself, or the terrain of that single mesh."""
        return ground if isinstance(ground, Terrain) else cls(ground)

    def put(self, name: str, mesh: MainMesh) -> None:
        """Adds a tile or takes the place of the one of that name; ground whose map comes elsewhere may have moved
        there."""
        old = self.tiles.get(name)
        if isinstance(old, HeightMap) and isinstance(mesh, HeightMap) and old is not mesh:
            if mesh.motion.corrects:
                correct_across(old, mesh)
            else:
                mesh.follow(old, mesh.time)
        self.tiles[name] = mesh
        self.layout_revision = next_revision()

    def remove(self, name: str) -> None:
        """Takes a tile away; raises `InputError` if there is none of that name."""
        self.tile(name)
        del self.tiles[name]
        self.layout_revision = next_revision()

    def tile(self, name: str) -> MainMesh:
        """The tile of that name; raises `InputError` if there is none."""
        try:
            return self.tiles[name]
        except KeyError:
            known = ", ".join(repr(tile) for tile in self.tiles) or "none yet"
            raise InputError("unknown_tile", f"there is no tile {name!r}; known: {known}") from None

    def shift_time(self, by: float) -> None:
        """Moves the times of all maps by so many seconds, when the clock they are stamped with is set anew."""
        for mesh in self.tiles.values():
            mesh.shift_time(by)

    def changed_since(self, revision: int) -> bool:
        """Whether any ground came, changed or went after `revision` had a value."""
        return self.revision > revision

    @property
    def revision(self) -> int:
        """The revision of what changed last."""
        return max([self.layout_revision, *(mesh.revision for mesh in self.tiles.values())])

    @property
    def widest_cell(self) -> float:
        """The coarsest resolution of any height map [m]; so wide a gap may be between tiles that do not overlap."""
        return max((m.geometry.resolution for m in self.tiles.values() if isinstance(m, HeightMap)), default=0.0)

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Ground under N points (N, 2) [m] at ``time`` [s]; NaN where no tile has ground. Shapes (N,)."""
        points = np.atleast_2d(np.asarray(xy_w, np.float64))
        heights = np.full(len(points), np.nan)
        velocities = np.zeros(len(points))
        for mesh in self.tiles.values():
            missing = np.isnan(heights)
            if not missing.any():
                break
            found = mesh.at(points[missing], time)
            heights[missing] = found.heights
            velocities[missing] = found.velocities
        return Samples(heights, velocities)

    def around(self, xy_w: FloatArray, time: float) -> Samples:
        """Ground under points (N, 2) [m] as a patch that crosses from tile to tile sees it: as `at`, and in the gap of
        a cell between tiles that do not overlap what lies between their edges. Shapes (N,)."""
        heights, velocities = self.at(xy_w, time)
        gap = np.flatnonzero(np.isnan(heights))
        if not gap.size:
            return Samples(heights, velocities)
        maps = [mesh for mesh in self.tiles.values() if isinstance(mesh, HeightMap)]
        widest = self.widest_cell * (1.0 + 1e-6)
        total = np.zeros((3, gap.size))  # weights, weighted heights, weighted velocities
        sides = np.zeros(gap.size, np.int64)
        for heightmap in maps:
            beyond = heightmap.beyond(xy_w[gap])
            near = np.flatnonzero((beyond > 0.0) & (beyond <= widest))
            if near.size:
                edge = heightmap.at_edge(xy_w[gap[near]], time)
                known = ~np.isnan(edge.heights)
                weight = 1.0 / beyond[near[known]]
                total[:, near[known]] += weight, weight * edge.heights[known], weight * edge.velocities[known]
                sides[near[known]] += 1
        bridged = sides > 1  # beside one tile only there is nothing to reach
        heights[gap[bridged]] = total[1, bridged] / total[0, bridged]
        velocities[gap[bridged]] = total[2, bridged] / total[0, bridged]
        return Samples(heights, velocities)
