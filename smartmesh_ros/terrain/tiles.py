"""Height maps and meshes by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Self

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, require
from smartmesh_ros.terrain.grid_track import cells_moved
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import next_revision
from smartmesh_ros.terrain.scrolling import carry_material, follow_across
from smartmesh_ros.terrain.trimesh import TriangleMesh

MainMesh = HeightMap | TriangleMesh
# What the saved state of tiles is made of, by name.
_KINDS: dict[str, type[HeightMap] | type[TriangleMesh]] = {kind.__name__: kind for kind in (HeightMap, TriangleMesh)}


class Tiles:
    """Tiles by name, each a height map or a general mesh. A single tile has the name ``""``.

    ``core``: the core's, which the grounds of these tiles read in each step.
    """

    def __init__(self, single: MainMesh | None = None) -> None:
        self._tiles: dict[str, MainMesh] = {}
        self.numbers: dict[str, int] = {}  # of the tiles; a tile keeps its number, and no other one gets it
        self._next_number = 0
        self.core = self._new_core()
        self._changed()
        if single is not None:
            self.put("", single)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "core"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.core = self._new_core()
        self._changed()  # a copy is other ground

    def _new_core(self) -> Any:
        return CORE.Tiles()

    def _changed(self) -> None:
        """Tell the core of tiles that came or went."""
        self._layout = next_revision()
        self.core.set_tiles(self.readers)

    def state(self) -> dict[str, Any]:
        """Return the whole state of the tiles, as a tree for `state_file.to_bytes`; arrays are not copied."""
        tiles = {name: [type(mesh).__name__, mesh.__getstate__()] for name, mesh in self.tiles.items()}
        return {"tiles": tiles, "numbers": self.numbers, "next_number": self._next_number}

    def take_state(self, state: dict[str, Any]) -> None:
        """Have the tiles of such a state, and none besides; raises `InputError` if it is none."""
        for name, (kind, kept) in state["tiles"].items():
            mesh = self._tiles[name] = _KINDS[kind].__new__(_KINDS[kind])
            mesh.__setstate__(kept)
        self.numbers, self._next_number = dict(state["numbers"]), int(state["next_number"])
        self._changed()
        if self.numbers.keys() != self.tiles.keys():
            raise InputError("state", "the tiles of a saved terrain are not those that have numbers")

    def become(self, other: Self) -> Callable[[], None]:
        """Take the tiles of another one, which must not be used any more; return the function that undoes it. Tiles of
        the same name and kind stay the same objects, with the contents of the other's."""
        known = dict(vars(self)), [(mesh, dict(vars(mesh))) for mesh in self.tiles.values()]

        def undo() -> None:
            vars(self).update(known[0])
            for mesh, kept in known[1]:
                _replace_contents(mesh, kept)
            self._changed()

        tiles = dict(other.tiles)
        for name, mesh in other.tiles.items():
            if type(own := self.tiles.get(name)) is type(mesh):
                _replace_contents(own, vars(mesh))
                tiles[name] = own
        vars(self).update(vars(other), _tiles=tiles)
        self._changed()
        return undo

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
        if name not in self.numbers:
            self.numbers[name], self._next_number = self._next_number, self._next_number + 1
        self._changed()

    def remove(self, name: str) -> None:
        """Remove a tile; raises `InputError` if no tile has that name."""
        self.tile(name)
        del self._tiles[name], self.numbers[name]
        self._changed()

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
        return max([self._layout, *(mesh.revision for mesh in self.tiles.values())])

    @property
    def readers(self) -> list[Any]:
        """The core's readers of all tiles."""
        return [mesh.core_reader for mesh in self.tiles.values()]


def require_tile_name(name: Any) -> None:
    """Raise `InputError` unless a name can be that of a tile or a deck."""
    require(isinstance(name, str), "name", "the name of a tile or deck", name, "a text")


def _replace_contents(mesh: Any, contents: dict[str, Any]) -> None:
    """Let a mesh be another one of its kind."""
    vars(mesh).clear()
    vars(mesh).update(contents)
