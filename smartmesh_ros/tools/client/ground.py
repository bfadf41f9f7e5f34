"""The terrain from its messages: height maps with region updates, and general meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TerrainMesh, TerrainMeshUpdate

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs import cdr_reader
from smartmesh_ros.terrain.deck import Deck
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.scrolling import carry_material
from smartmesh_ros.terrain.surface_query import RayCaster, checked_rays
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.tools.client.sight import Pose

# The node's topics of terrain: their types, and what reads their messages.
MAPS: dict[str, tuple[Any, Callable[[bytes], Any]]] = {
    "heightmap": (Heightmap, cdr_reader.map_from),
    "heightmap_update": (HeightmapUpdate, cdr_reader.region_from),
    "pressed_ground": (HeightmapUpdate, cdr_reader.region_from),
    "terrain_mesh": (TerrainMesh, cdr_reader.mesh_from),
    "terrain_mesh_update": (TerrainMeshUpdate, cdr_reader.mesh_update_from),
}
# The ground is shown as the last map says.
STILL = MotionConfig(mode="hold")
# Messages that may wait. One more applies them all, so that memory stays bounded while no page is open.
MAX_WAITING = 2000


class Ground:
    """All ``tiles`` by name, and the heights of the ``first`` map of each (rows, columns) [m]. Tiles of the decks among
    ``frames`` lie in these. ``shown``: the tiles, or while there are none the ground that the node draws. Messages wait
    until `apply_waiting`, because a newer map often replaces them first."""

    def __init__(self) -> None:
        self.tiles: dict[str, MainMesh] = {}
        self.frames: Mapping[str, Pose] = {}
        self.first: dict[str, NDArray[np.float32]] = {}
        self._drawn: dict[str, MainMesh] = {}
        self._waiting: list[Any] = []  # what the readers of `MAPS` return

    @property
    def shown(self) -> Mapping[str, MainMesh]:
        return self.tiles or self._drawn

    def draw(self, corners: FloatArray) -> None:
        """Take the ground that the node draws, by the corners (n, 3) [m] of its triangles."""
        if not self.tiles:
            triangles = np.arange(len(corners) // 3 * 3).reshape(-1, 3)
            self._drawn = {"": TriangleMesh(corners, triangles, motion=STILL)} if len(triangles) else {}

    def take(self, topic: str, data: bytes) -> None:
        """Queue a message of a topic of `MAPS`. A whole map or mesh replaces what waits for its tile.
        Malformed ones are skipped, because the node reports them."""
        with suppress(InputError):
            new = MAPS[topic][1](data)
            if isinstance(new, cdr_reader.MapInput | cdr_reader.MeshInput):
                self._waiting = [other for other in self._waiting if other.start.name != new.start.name]
            self._waiting.append(new)
        if len(self._waiting) > MAX_WAITING:
            self.apply_waiting()

    def apply_waiting(self) -> None:
        """Apply all waiting messages, but those that fit no tile."""
        waiting, self._waiting = self._waiting, []
        for new in waiting:
            with suppress(InputError):
                self._apply(new)

    def deck_of(self, tile: str) -> str | None:
        """Return the deck that a tile's name begins with, alone or before a slash; None = it is on none."""
        deck = tile.partition("/")[0]
        return deck if deck in self.frames else None

    def terrain(self) -> Terrain:
        """Return the tiles as terrain, with those of decks on decks."""
        found = Terrain()
        for name, mesh in self.shown.items():
            if (deck := self.deck_of(name)) is None:
                found.put(name, mesh)
                continue
            if deck not in found.decks:
                (w, x, y, z), position = self.frames[deck].wxyz, self.frames[deck].position
                found.put(deck, Deck(position=position, orientation=(x, y, z, w)))
            found.decks[deck].put(name, mesh)
        return found

    def heights(self, xy_w: FloatArray) -> FloatArray:
        """Return the height (n,) [m] of the ground at points (n, 2) [m]; NaN where there is none."""
        return self.terrain().at(xy_w, 0.0).heights

    def distances(self, origins: FloatArray, directions: FloatArray, reach: float = 500.0) -> FloatArray:
        """Return the distances (n,) [m] at which rays from (n, 3) [m] along (n, 3) first meet the ground, infinity =
        not within ``reach`` [m]."""
        return RayCaster(self.terrain()).cast(checked_rays(origins, directions, reach), 0.0).distances

    def _apply(self, new: Any) -> None:
        tile = new.start.name
        known = self.tiles.get(tile)
        if isinstance(new, cdr_reader.RegionInput):
            if isinstance(known, HeightMap):
                known.update_region(new.row, new.column, new.heights, time=0.0, material=new.material)
        elif isinstance(new, cdr_reader.MeshUpdateInput):
            if isinstance(known, TriangleMesh):
                known.move(new.vertices, indices=new.indices, time=0.0)
        elif isinstance(new, cdr_reader.MeshInput) and len(new.vertices):
            self.tiles[tile] = TriangleMesh(new.vertices, new.triangles, motion=STILL)
        elif isinstance(new, cdr_reader.MapInput) and (raster := new.raster) is not None:
            # A new map beside the old one, from which no motion is estimated.
            shown = HeightMap(raster.heights, geometry=raster.geometry, material=raster.material, motion=STILL)
            if isinstance(known, HeightMap):
                carry_material(known, shown)
            if not (isinstance(known, HeightMap) and known.geometry == raster.geometry):
                self.first[tile] = raster.heights
            self.tiles[tile] = shown
        else:  # an empty message removes its tile
            self.tiles.pop(tile, None)
            self.first.pop(tile, None)
