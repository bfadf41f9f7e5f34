"""The terrain under the bodies: one main mesh or several tiles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.corrections import FusedMap
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.terrain.grid_track import GridTrack, RigidMotion, cells_moved
from smartmesh_ros.terrain.heightmap import HeightMap, Samples, ground_heights
from smartmesh_ros.terrain.material import Material
from smartmesh_ros.terrain.motion import MotionConfig, next_revision
from smartmesh_ros.terrain.scrolling import carry_material, follow_across
from smartmesh_ros.terrain.trimesh import TriangleMesh

MainMesh = HeightMap | TriangleMesh
# What the saved state of a terrain is made of, by name.
_KINDS: dict[str, type[HeightMap] | type[TriangleMesh]] = {kind.__name__: kind for kind in (HeightMap, TriangleMesh)}
STATE_TYPES: dict[str, type] = {
    each.__name__: each for each in (GridGeometry, MotionConfig, GridTrack, RigidMotion, FusedMap, Material)
}


class Terrain:
    """Tiles by name, each a height map or a general mesh. A single tile has the name ``""``."""

    def __init__(self, single: MainMesh | None = None) -> None:
        self.tiles: dict[str, MainMesh] = {}
        self.numbers: dict[str, int] = {}  # of the tiles; a tile keeps its number, and no other one gets it
        self._next_number = 0
        self.layout_revision = next_revision()  # changes when a tile is added, removed or replaced
        if single is not None:
            self.put("", single)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.layout_revision = next_revision()  # a copy is other ground

    def state(self) -> dict[str, Any]:
        """Return all that the terrain goes on from, as a tree for `state_file.to_bytes`; arrays are not copied."""
        tiles = {name: [type(mesh).__name__, mesh.__getstate__()] for name, mesh in self.tiles.items()}
        return {"tiles": tiles, "numbers": self.numbers, "next_number": self._next_number}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Terrain:
        """Return the terrain of such a state; raises `InputError` if it is none."""
        made = cls()
        for name, (kind, kept) in state["tiles"].items():
            mesh = made.tiles[name] = _KINDS[kind].__new__(_KINDS[kind])
            mesh.__setstate__(kept)
        made.numbers, made._next_number = dict(state["numbers"]), int(state["next_number"])
        if made.numbers.keys() != made.tiles.keys():
            raise InputError("state", "the tiles of a saved terrain are not those that have numbers")
        return made

    def become(self, other: Terrain) -> Callable[[], None]:
        """Take the tiles of another terrain, which must not be used any more; return what undoes it. Whoever holds a
        tile of this one holds the restored one of the same name and kind."""
        known = dict(vars(self)), [(mesh, dict(vars(mesh))) for mesh in self.tiles.values()]

        def undo() -> None:
            vars(self).update(known[0], layout_revision=next_revision())
            for mesh, kept in known[1]:
                _replace_contents(mesh, kept)

        tiles = dict(other.tiles)
        for name, mesh in other.tiles.items():
            if type(own := self.tiles.get(name)) is type(mesh):
                _replace_contents(own, vars(mesh))
                tiles[name] = own
        vars(self).update(vars(other), tiles=tiles, layout_revision=next_revision())
        return undo

    @classmethod
    def of(cls, ground: MainMesh | Terrain) -> Terrain:
        """Return ``ground`` if it is a terrain, else a terrain with that single mesh."""
        return ground if isinstance(ground, Terrain) else cls(ground)

    def put(self, name: str, mesh: MainMesh) -> None:
        """Add a tile or replace the tile of that name.

        If a height map replaces another one, its motion or correction is estimated from both, as by
        `HeightMap.replace`; velocities that were given with the map are kept. The ground keeps the layers of its
        material that the new map was not given: what is new in a map are its heights.
        """
        if not isinstance(mesh, MainMesh):
            raise InputError(
                "terrain", f"the terrain is of type {type(mesh).__name__}; pass HeightMap(heights, resolution=...), "
                "a TriangleMesh, or a Terrain of several"
            )  # fmt: skip
        old = self.tiles.get(name)
        if isinstance(old, HeightMap) and isinstance(mesh, HeightMap) and old is not mesh:
            carry_material(old, mesh)
            if mesh.motion.corrects:
                mesh.correct_from(old, cells_moved(old.geometry, mesh.geometry))
            else:
                follow_across(old, mesh)
        self.tiles[name] = mesh
        if name not in self.numbers:
            self.numbers[name], self._next_number = self._next_number, self._next_number + 1
        self.layout_revision = next_revision()

    def remove(self, name: str) -> None:
        """Remove a tile; raises `InputError` if no tile has that name."""
        self.tile(name)
        del self.tiles[name], self.numbers[name]
        self.layout_revision = next_revision()

    def tile(self, name: str) -> MainMesh:
        """Return a tile; raises `InputError` if no tile has that name."""
        try:
            return self.tiles[name]
        except KeyError:
            known = ", ".join(repr(tile) for tile in self.tiles) or "none yet"
            raise InputError("unknown_tile", f"there is no tile {name!r}; known: {known}") from None

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to the times of all maps, after their clock was reset or lost time."""
        for mesh in self.tiles.values():
            mesh.shift_time(by)

    @property
    def revision(self) -> int:
        """Revision of the latest change."""
        return max([self.layout_revision, *(mesh.revision for mesh in self.tiles.values())])

    @property
    def widest_cell(self) -> float:
        """Coarsest resolution of all height maps [m], the widest gap between tiles that is bridged."""
        return max((m.geometry.resolution for m in self.tiles.values() if isinstance(m, HeightMap)), default=0.0)

    @property
    def readers(self) -> list[Any]:
        """The core's readers of all tiles."""
        return [mesh.core_reader for mesh in self.tiles.values()]

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Return the highest ground under N points (N, 2) [m] at ``time`` [s], shapes (N,); NaN = no ground.

        A point on several height maps belongs to the first one that has ground there. Gaps of up to a cell between
        height maps are ground, too.
        """
        return ground_heights(self.readers, xy_w, time)

    def friction_at(self, xy_w: FloatArray) -> FloatArray:
        """Return the coefficients of friction of the ground at points (N, 2) [m], shape (N,).

        They are those of the nearest sample of the first height map that has ground there, and 1 elsewhere.
        """
        found = np.full(len(xy_w), np.nan)
        unknown = np.ones(len(xy_w), np.bool_)
        maps = [mesh for mesh in self.tiles.values() if isinstance(mesh, HeightMap)]
        for heightmap in maps if any(heightmap.material.friction is not None for heightmap in maps) else ():
            chosen = np.flatnonzero(unknown & (heightmap.beyond(xy_w) <= 0.0))
            rows, columns = np.rint(heightmap.geometry.to_grid(xy_w[chosen])).astype(np.int64).T
            ground = ~np.isnan(heightmap.heights[rows, columns])
            here = chosen[ground]
            unknown[here] = False
            friction = heightmap.friction
            found[here] = friction if isinstance(friction, float) else friction[rows[ground], columns[ground]]
        found[np.isnan(found)] = 1.0
        return found


def _replace_contents(mesh: Any, contents: dict[str, Any]) -> None:
    """Let a mesh be another one of its kind."""
    vars(mesh).clear()
    vars(mesh).update(contents)
