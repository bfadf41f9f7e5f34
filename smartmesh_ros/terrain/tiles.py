"""Height maps and meshes by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Self

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, named, require
from smartmesh_ros.terrain.grid_track import cells_moved
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import next_revision
from smartmesh_ros.terrain.scrolling import carry_material, follow_across
from smartmesh_ros.terrain.trimesh import TriangleMesh

MainMesh = HeightMap | TriangleMesh


class Tiles:
    """Tiles by name, each a height map or a general mesh. A single tile has the name ``""``.

    ``core``: the core's, which the grounds of these tiles read in each step.
    """

    _CORE: Any = CORE.Tiles

    def __init__(self, single: MainMesh | None = None) -> None:
        self._begin({})
        if single is not None:
            self.put("", single)

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and saved states are made of."""
        return {"tiles": self._tiles}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._begin(dict(state["tiles"]))  # a copy is other ground

    def _begin(self, tiles: dict[str, MainMesh]) -> None:
        """Have these tiles, and a core of its own."""
        self._tiles, self.core = tiles, self._CORE()
        self._changed()

    def _changed(self) -> None:
        """Tell the core of tiles that came or went."""
        self._layout = next_revision()
        self.core.set_tiles(self.readers)

    def become(self, other: Self) -> None:
        """Be another one, which must not be used any more. Tiles of the same name and kind stay the same objects, with
        the contents of the other's."""
        vars(self).update(vars(other), _tiles=in_place(self._tiles, other._tiles))
        self._changed()

    @property
    def tiles(self) -> Mapping[str, MainMesh]:
        """The tiles by name, to read; `put` and `remove` change them."""
        return MappingProxyType(self._tiles)

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
        require_tile_name(name)
        old = self.tiles.get(name)
        if isinstance(old, HeightMap) and isinstance(mesh, HeightMap) and old is not mesh:
            carry_material(old, mesh)
            if mesh.motion.corrects:
                mesh.correct_from(old, cells_moved(old.geometry, mesh.geometry))
            else:
                follow_across(old, mesh)
        self._tiles[name] = mesh
        self._changed()

    def remove(self, name: str) -> None:
        """Remove a tile; raises `InputError` if no tile has that name."""
        self.tile(name)
        del self._tiles[name]
        self._changed()

    def tile(self, name: str) -> MainMesh:
        """Return a tile; raises `InputError` if no tile has that name."""
        return named(name, self._tiles, "unknown_tile", "tile")

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to the times of all maps, after their clock was reset or lost time."""
        for mesh in self.tiles.values():
            mesh.shift_time(by)

    @property
    def revision(self) -> int:
        """Revision of the latest change."""
        return max([self._layout, *(mesh.revision for mesh in self.tiles.values())])

    @property
    def readers(self) -> list[Any]:
        """The core's readers of all tiles."""
        return [mesh.core_reader for mesh in self.tiles.values()]


def require_tile_name(name: Any) -> None:
    """Raise `InputError` unless a name can be that of a tile or a deck."""
    require(isinstance(name, str), "name", "the name of a tile or deck", name, "a text")


def in_place(own: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ``new`` parts of a terrain by name; those of the name and kind of an ``own`` one are that object, with
    the contents of the new one."""
    parts = dict(new)
    for name in own.keys() & new.keys():
        if type(own[name]) is type(new[name]):
            own[name].become(new[name])
            parts[name] = own[name]
    return parts
