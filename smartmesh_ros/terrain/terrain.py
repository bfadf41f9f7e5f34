"""The terrain under the bodies: the ground at rest of one main mesh or several tiles, and decks that ride on frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError, named
from smartmesh_ros.terrain.deck import Deck
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.grid_track import GridTrack, RigidMotion
from smartmesh_ros.terrain.heightmap import HeightMap, Samples, ground_heights
from smartmesh_ros.terrain.material import Material
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.tiles import MainMesh, Tiles, in_place, require_tile_name
from smartmesh_ros.terrain.trimesh import TriangleMesh

__all__ = ["MainMesh", "Terrain"]


class Terrain(Tiles):
    """Tiles by name, each a height map or a general mesh, and ``decks`` by name, which have tiles of their own and may
    move. A single tile has the name ``""``."""

    def __init__(self, single: MainMesh | None = None) -> None:
        self._decks: dict[str, Deck] = {}
        super().__init__(single)

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "decks": self._decks}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._decks = dict(state["decks"])
        super().__setstate__(state)

    def become(self, other: Terrain) -> None:
        """Take tiles and decks of another terrain, as `Tiles.become` does. Grounds on this terrain stay on it."""
        self._tiles, self._decks = in_place(self._tiles, other._tiles), in_place(self._decks, other._decks)
        self._changed()

    @contextmanager
    def unchanged(self) -> Iterator[None]:
        """Let the terrain, its decks and tiles be as before if the block raises."""
        known = [(part, dict(vars(part))) for part in (self, *self.decks.values(), *self.meshes)]
        try:
            yield
        except BaseException:
            for part, contents in known:
                vars(part).clear()
                vars(part).update(contents)
            self._changed()
            raise

    @classmethod
    def of(cls, ground: MainMesh | Terrain) -> Terrain:
        """Return ``ground`` if it is a terrain, else a terrain with that single mesh."""
        return ground if isinstance(ground, Terrain) else cls(ground)

    def put(self, name: str, mesh: MainMesh | Deck) -> None:
        """Add a tile or a deck, or replace that of this name; see `Tiles.put`. Raises `InputError` if a tile has the
        name of a deck."""
        require_tile_name(name)
        taken, kind = (self.tiles, "tile") if isinstance(mesh, Deck) else (self.decks, "deck")
        if name in taken:
            raise InputError("name", f"{name!r} is the name of a {kind}; remove it, or choose another name")
        if not isinstance(mesh, Deck):
            super().put(name, mesh)
            return
        self._decks[name] = mesh
        self._changed()

    def remove(self, name: str) -> None:
        """Remove a tile or a deck; raises `InputError` if none has that name."""
        require_tile_name(name)
        if name not in self.decks:
            super().remove(name)
            return
        del self._decks[name]
        self._changed()

    @property
    def decks(self) -> Mapping[str, Deck]:
        """The decks by name, to read; `put` and `remove` change them."""
        return MappingProxyType(self._decks)

    def deck(self, name: str) -> Deck:
        """Return a deck; raises `InputError` if none has that name."""
        return named(name, self._decks, "unknown_deck", "deck")

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to the times of all maps and decks, after their clock was reset or lost time."""
        super().shift_time(by)
        for deck in self.decks.values():
            deck.shift_time(by)

    def moving(self, time: float) -> bool:
        """Return True if a tile or the frame of a deck may move at ``time`` [s]."""
        return any(it.moving(time) for it in (*self.meshes, *self.decks.values()))

    @property
    def empty(self) -> bool:
        """True if there is no ground at all."""
        return not self.meshes

    @property
    def meshes(self) -> list[MainMesh]:
        """All tiles, also those of decks."""
        return [mesh for of in (self, *self.decks.values()) for mesh in of.tiles.values()]

    @property
    def revision(self) -> int:
        """Revision of the latest change of a tile, also of decks; their frames' motion does not count."""
        return max([super().revision, *(deck.revision for deck in self.decks.values())])

    @property
    def readers(self) -> list[Any]:
        """The core's readers of all tiles and decks."""
        return [*super().readers, *(deck.core for deck in self.decks.values())]

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Return the highest ground under N points (N, 2) [m] at ``time`` [s], shapes (N,); NaN = no ground.

        A point on several height maps belongs to the first one that has ground there. Gaps of up to a cell between
        height maps are ground, too. Decks are ground where they are highest.
        """
        return ground_heights(self.core, xy_w, time)


# What saved states have of a terrain, by name.
STATE_TYPES: dict[str, type] = {
    each.__name__: each
    for each in (
        *(Terrain, Deck, HeightMap, TriangleMesh),
        *(GridGeometry, MotionConfig, GridTrack, RigidMotion, Material),
    )
}
