"""The terrain on the page: a mesh a tile, at full resolution near bodies, and the colours of depth and material."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from time import monotonic
from typing import Any, Literal, NamedTuple
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.colours import FRICTION, GROUND, Colour
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.client.sight import Pose
from smartmesh_ros.tools.view.decimation import decimate
from smartmesh_ros.tools.view.looks import Legend

# Height at which the colours of ground are drawn above it [m], below patches.
LIFT = np.array([0.0, 0.0, 0.003], np.float32)


# Least difference of the drawn ground from that under a patch [m]. It is less than patches are drawn above the ground.
SEEN = 1e-3


class Depth(Legend):
    """Entries of the legend of sunk ground."""

    SLIGHT = "1 to 5 mm", (250, 226, 150), 0.001
    SHALLOW = "5 to 15 mm", (247, 176, 80), 0.005
    DEEP = "15 to 40 mm", (226, 106, 44), 0.015
    DEEPEST = "more than 40 mm", (158, 38, 34), 0.04


class Grip(Legend):
    """Entries of the legend of the ground's friction; 1 has the colour of ground."""

    ICE = "friction below 0.3", FRICTION[0.0], 0.0
    SLIPPERY = "0.3 to 0.7", FRICTION[0.3], 0.3
    FIRM = "0.7 to 1", FRICTION[0.7], 0.7
    ROUGH = "more than 1", FRICTION[1.0], 1.0


class Give(Legend):
    """Entries of the legend of ground that gives, by its depth under a pressure of 1 kPa [mm]."""

    FIRM = "gives 0.1 to 1 mm under 1 kPa", (186, 214, 160), 0.1
    SOFT = "1 to 10 mm", (134, 188, 108), 1.0
    SOFTEST = "more than 10 mm", (78, 148, 66), 10.0


class Mesh(NamedTuple):
    """``vertices`` (V, 3) [m] and ``triangles`` (T, 3) of one ``colour``, seen from the front or from both sides."""

    vertices: NDArray[Any]
    triangles: NDArray[Any]
    colour: Colour
    side: Literal["front", "double"] = "front"


class Meshes:
    """The meshes of one part of a scene, by path. Only changes are sent to browsers."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._handles: dict[str, Any] = {}

    def show(self, meshes: Mapping[str, Mesh]) -> None:
        """Show these meshes and no others."""
        for path in self._handles.keys() - meshes.keys():
            self._handles.pop(path).remove()
        for path, mesh in meshes.items():
            known = self._handles.get(path)
            if known is not None and np.array_equal(known.faces, mesh.triangles):
                known.vertices = mesh.vertices
            else:
                self._handles[path] = self._scene.add_mesh_simple(
                    path, mesh.vertices, mesh.triangles, color=mesh.colour, side=mesh.side, cast_shadow=False
                )


# Distance around each body with full resolution, in radii, and at least [samples].
MARGIN, LEAST = 2.0, 8.0
# Minimum time between two decimations [s], which take tens of milliseconds for a large map.
PERIOD = 0.5


class TerrainScene:
    """Draws the tiles of a `Ground` in a viser scene."""

    def __init__(self, scene: Any) -> None:
        self._scene, self._meshes = scene, Meshes(scene)
        self._frames: dict[str, Any] = {}  # of decks
        self._reliefs: dict[str, _Relief] = {}

    def show(
        self, ground: Ground, bodies: FloatArray, radii: FloatArray, patches: Iterable[Patch], *, sunk: bool = False
    ) -> None:
        """Refresh the tiles, with bodies at (B, 3) [m] of ``radii`` (B,) [m]. Under their ``patches`` the ground is
        that of the patches' instant. ``sunk``: colour the ground that lies below its first map."""
        of_tile: dict[str, list[Patch]] = defaultdict(list)
        for patch in patches:
            of_tile[patch.tile].append(patch)
        meshes = {}
        for name, tile in ground.shown.items():
            # One part of a path, because viser removes what is below a path with it.
            deck, path = ground.deck_of(name), f"/terrain/tile_{quote(name, safe='')}"
            root = self._frame_of(deck, ground.frames[deck]) if deck else ""
            if not isinstance(tile, HeightMap):
                meshes[root + path] = Mesh(tile.vertices, tile.triangles, GROUND)
                continue
            relief = self._reliefs.get(name)
            if relief is None or (relief.geometry, relief.root) != (tile.geometry, root):
                relief = self._reliefs[name] = _Relief(root, path, tile.geometry)
            if not deck:
                relief.follow(tile, of_tile[name])
            near = ground.frames[deck].inside(bodies) if deck else bodies
            meshes |= relief.meshes(tile, near, radii, ground.first[name] if sunk else None)
        self._meshes.show(meshes)
        self._reliefs = {name: relief for name, relief in self._reliefs.items() if name in ground.tiles}

    def _frame_of(self, deck: str, pose: Pose) -> str:
        path = f"/decks/{deck}"
        if deck not in self._frames:
            self._frames[deck] = self._scene.add_frame(path, show_axes=False)
        self._frames[deck].position, self._frames[deck].wxyz = pose
        return path


class _Relief:
    """A height map as a decimated mesh. What was made is kept while neither the map nor the bodies have changed."""

    def __init__(self, root: str, path: str, geometry: GridGeometry) -> None:
        self.root, self._path, self.geometry = root, path, geometry
        self._centres, self._due = np.full((1, 2), np.inf), 0.0
        self._made: dict[str, Mesh] = {}
        # Revision of the map, whether sunk ground was coloured, and the heights under patches.
        self._made_from: tuple[int, bool, bytes] | None = None
        # Samples whose ground has moved since the map, ascending, and their heights [m].
        self._moved, self._heights = np.empty(0, np.int64), np.empty(0)

    def follow(self, tile: HeightMap, patches: list[Patch]) -> None:
        """Take the heights under patches where they are no longer those of the map."""
        parts = [patch.vertices_w for patch in patches if patch.kind == "heightfield"]
        vertices = np.concatenate([np.empty((0, 3)), *parts])
        vertices = vertices[~np.isnan(vertices[:, 2])]
        cells = np.rint(self.geometry.to_grid(vertices[:, :2])).astype(np.int64)
        inside = ((cells >= 0) & (cells <= self.geometry.last)).all(axis=1)
        places, first = np.unique(cells[inside] @ (self.geometry.columns, 1), return_index=True)
        heights = vertices[inside][first, 2]
        moved = np.abs(tile.heights.ravel()[places] + self.geometry.origin[2] - heights) > SEEN
        self._moved, self._heights = places[moved], heights[moved]

    def meshes(
        self, tile: HeightMap, bodies: FloatArray, radii: FloatArray, first: NDArray[np.float32] | None
    ) -> dict[str, Mesh]:
        """Return the ground with bodies at (B, 3) [m] of ``radii`` (B,) [m], the colours of its material, and of what
        lies below the heights of its ``first`` map (rows, columns) [m], by path."""
        wanted = tile.revision, first is not None, self._moved.tobytes() + self._heights.tobytes()
        if self._cut(bodies, radii) or wanted != self._made_from:
            self._made_from, self._made = wanted, dict(self._make(tile, first))
        return self._made

    def _make(self, tile: HeightMap, first: NDArray[np.float32] | None) -> Iterator[tuple[str, Mesh]]:
        place, triangles = (self._surface.rows, self._surface.columns), self._surface.triangles
        heights = tile.heights[place]
        holes = np.isnan(heights)
        z = np.where(holes, 0.0, heights + self.geometry.origin[2])
        if self._moved.size:
            samples = place[0] * self.geometry.columns + place[1]
            at = np.minimum(np.searchsorted(self._moved, samples), self._moved.size - 1)
            z = np.where(self._moved[at] == samples, self._heights[at], z)
        if holes.any():
            triangles = triangles[~holes[triangles].any(axis=1)]
        vertices = np.column_stack([self._xy, z]).astype(np.float32)
        yield self.root + self._path, Mesh(vertices, triangles, GROUND)
        coloured: list[tuple[str, type[Legend], FloatArray]] = []
        stiffness = tile.material.stiffness
        if stiffness is not None:
            gives = 1e6 / np.broadcast_to(np.asarray(stiffness, np.float64), tile.heights.shape)[place]
            coloured.append(("give", Give, np.where(np.isnan(gives), 0.0, gives)))
        if tile.material.friction is not None:
            friction = np.broadcast_to(tile.friction, tile.heights.shape)[place].astype(np.float64)
            friction[np.isnan(friction) | (friction == 1.0)] = -1.0  # below all entries
            coloured.append(("grip", Grip, friction))
        if first is not None:
            coloured.append(("sunk", Depth, first[place].astype(np.float64) - heights))
        for kind, bands, values in coloured:
            for band, chosen in triangles_by_band(values, triangles, bands):
                used, places = np.unique(chosen, return_inverse=True)
                yield (
                    f"{self.root}/{kind}{self._path}/{band.name}",
                    Mesh(vertices[used] + LIFT, places.reshape(-1, 3), band.colour),
                )

    def _cut(self, bodies: FloatArray, radii: FloatArray) -> bool:
        """Decimate the map again if bodies have moved far; return True if it was decimated."""
        geometry = self.geometry
        centres = geometry.to_grid(bodies[:, :2])
        near = np.maximum(MARGIN * radii / geometry.resolution, LEAST)
        same = len(centres) == len(self._centres) and (np.abs(centres - self._centres) < 0.25 * near[:, None]).all()
        if same or monotonic() < self._due:
            return False
        self._due, self._centres = monotonic() + PERIOD, centres
        self._surface = decimate((geometry.rows, geometry.columns), centres, near)
        self._xy = geometry.to_world(self._surface.rows, self._surface.columns)
        return True


def triangles_by_band(values: FloatArray, triangles: IntArray, bands: type[Legend]) -> Iterator[tuple[Any, IntArray]]:
    """Yield each band that there is, and its triangles (n, 3), by the corner with the largest of the ``values`` (V,) of
    the vertices. Triangles with a NaN, or below the first band, are left out."""
    largest = np.nan_to_num(values[triangles].max(axis=1), nan=-np.inf)
    found = np.digitize(largest, [band.least for band in bands]) - 1
    for number, band in enumerate(bands):
        if (found == number).any():
            yield band, triangles[found == number]
