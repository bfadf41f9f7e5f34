"""The ground as PyBullet's window and pictures show it, and its rays meet it: a height field of each map and a collider
of each mesh, which nothing touches."""

from __future__ import annotations

import hashlib
import logging
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.quaternions import Z, about, quaternion_of
from smartmesh_ros.ground.state import Quaternion
from smartmesh_ros.ground.transform import IDENTITY, Transform
from smartmesh_ros.terrain.colours import ground_colours
from smartmesh_ros.terrain.deck import Frame, name_of_tile
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh

log = logging.getLogger("smartmesh_ros")

# Samples a side of the largest square map that is drawn at every sample. PyBullet takes 0.2 s for it without a graphics
# card.
LARGEST = 256
# Distance of heights from the base of their field that its bounds allow [m].
BOUND = 1e4
# Height of the base above the ground [m]. Below it, rays that come down miss nothing: PyBullet compares heights with
# places along y where it skips parts of a field.
ABOVE = 1.0
# Where a body is before nothing may touch it [m].
FAR_AWAY = (0.0, 0.0, -1e6)
# Most vertices and corners of triangles of a mesh that PyBullet takes.
MOST_VERTICES, MOST_CORNERS = 131072, 524288


Size = tuple[int, int, float]


@dataclass(eq=False)
class ShownTile:
    """A tile as it was drawn: its PyBullet body ``uid`` and ``shape``, of a height map also the ``size`` of the shape
    (rows, columns, spacing [m]), its ``revision``, True if it ``moved`` then, the ``friction`` that its colours are of,
    and the ``pose`` of the body in the frame of the terrain or the deck."""

    mesh: MainMesh
    uid: int
    shape: int
    size: Size | None = None
    pose: Transform = IDENTITY
    revision: int = -1
    moved: bool = False
    friction: Any = None

    def is_drawn(self, mesh: MainMesh, time: float) -> bool:
        """Return True if a tile at ``time`` [s] looks like this."""
        return self.mesh is mesh and self.revision == mesh.revision and not (self.moved or mesh.moving(time))


class ShownGround:
    """The tiles of a terrain in a PyBullet client, drawn at most ``rate`` times a second of simulated time, 0 = none.
    ``core``: the core's ground in the client."""

    def __init__(self, client: Any, core: Any, terrain: Terrain, rate: float) -> None:
        self.rate = rate
        self._client = client
        self._core = core
        self._terrain = terrain
        self._tiles: dict[str, ShownTile] = {}
        # PyBullet frees neither shapes of height fields nor textures, so that these are used again.
        self._unused: dict[Size, list[int]] = {}  # shapes
        self._textures: dict[bytes, int] = {}  # by digests of their images
        self._refused: set[str] = set()  # meshes that PyBullet cannot show
        self._drawn = math.nan  # when the ground was drawn last [s]

    @property
    def bodies(self) -> dict[str, int]:
        """PyBullet's bodies of the tiles by name, which rays report."""
        return {name: tile.uid for name, tile in self._tiles.items()}

    def refresh(self, time: float) -> None:
        """Draw the ground of ``time`` [s] if it is due, or the clock went back."""
        if self.rate and not 0.0 <= time - self._drawn < (1.0 - 1e-9) / self.rate:
            self.draw(time)

    def draw(self, time: float) -> None:
        """Draw the tiles that have changed, as they are at ``time`` [s]."""
        self._core.drawn, tiles = True, dict(self._terrain.tiles)
        frames: dict[str, Frame] = {}
        for deck, it in self._terrain.decks.items():
            for name, mesh in it.tiles.items():
                whole = name_of_tile(deck, name)
                tiles[whole], frames[whole] = mesh, it.frame(time)
        for name in list(self._tiles):
            is_there = self._core.is_ground(self._tiles[name].uid)  # the user may have removed it
            if name not in tiles or not is_there or not _fits(self._tiles[name], tiles[name]):
                self._remove(name)
        for name, mesh in tiles.items():
            if name in self._tiles and self._tiles[name].is_drawn(mesh, time):
                continue
            if isinstance(mesh, HeightMap):
                self._draw_map(name, mesh, time)
            elif self._takes(name, mesh):
                self._draw_mesh(name, mesh, time)
            else:
                continue
            shown = self._tiles[name]
            shown.mesh, shown.revision, shown.moved = mesh, mesh.revision, mesh.moving(time)
            self._client.resetBasePositionAndOrientation(shown.uid, *shown.pose)
        for name in frames.keys() & self._tiles.keys():
            shown, frame = self._tiles[name], frames[name]
            x, y, z = frame.position.tolist()
            pose = Transform((x, y, z), quaternion_of(frame.rotation)).then(shown.pose)
            self._client.resetBasePositionAndOrientation(shown.uid, *pose)
        self._drawn = time

    def hide(self) -> None:
        """Remove the tiles, unless the client was reset or closed."""
        self.rate = 0.0
        if self._core.is_there:
            for name in list(self._tiles):
                self._remove(name)
            self._core.drawn = False
        self._tiles.clear()

    def _draw_map(self, name: str, heightmap: HeightMap, time: float) -> None:
        geometry, client = heightmap.geometry, self._client
        fewest = min(geometry.rows, geometry.columns) - 1
        stride = min(math.ceil(math.sqrt(geometry.size) / LARGEST), fewest)
        rows, columns = np.arange(0, geometry.rows, stride), np.arange(0, geometry.columns, stride)
        shown = self._tiles.get(name)
        if shown is None:
            size = len(rows), len(columns), stride * geometry.resolution
            unused = self._unused.get(size)
            shape = unused.pop() if unused else make_shape(client, *size, BOUND)
            shown = self._tiles[name] = ShownTile(heightmap, self._new_body(shape), shape, size)
        heights = heightmap.sample(rows[:, None] * geometry.columns + columns, time).heights
        base = 0.0 if np.isnan(heights).all() else float(np.nanmax(heights)) + ABOVE
        replace_heights(client, shown.shape, heights - base)
        placed = heightmap.placed_at(time)
        x, y = placed.to_world(0.5 * rows[-1], 0.5 * columns[-1]).tolist()
        shown.pose = Transform((x, y, base), quarter_turn(placed.yaw))
        if shown.friction is not heightmap.friction:
            shown.friction = heightmap.friction
            friction = np.broadcast_to(np.asarray(shown.friction, np.float32), heightmap.heights.shape)
            self._colour(shown.uid, ground_colours(friction[np.ix_(rows, columns)]))

    def _takes(self, name: str, mesh: TriangleMesh) -> bool:
        """Return True if PyBullet can show a mesh; say so once if it cannot."""
        if mesh.size <= MOST_VERTICES and mesh.triangles.size <= MOST_CORNERS:
            return True
        if name not in self._refused:
            log.warning(
                "the mesh %r is not drawn: it has %d vertices and %d triangles, and PyBullet shows up to %d and %d",
                name, mesh.size, len(mesh.triangles), MOST_VERTICES, MOST_CORNERS // 3,
            )  # fmt: skip
            self._refused.add(name)
        return False

    def _draw_mesh(self, name: str, mesh: TriangleMesh, time: float) -> None:
        """Draw a mesh anew: PyBullet cannot replace its vertices."""
        if name in self._tiles:
            self._remove(name)
        vertices = mesh.sample(np.arange(mesh.size), time).positions
        shape = self._client.createCollisionShape(
            pb.GEOM_MESH, vertices=vertices.tolist(), indices=mesh.triangles.ravel().tolist(),
            flags=pb.GEOM_FORCE_CONCAVE_TRIMESH,
        )  # fmt: skip
        self._tiles[name] = shown = ShownTile(mesh, self._new_body(shape), shape)
        self._colour(shown.uid, ground_colours(np.ones((2, 2))))

    def _new_body(self, shape: int) -> int:
        """Create a body that nothing touches."""
        uid = int(self._client.createMultiBody(0.0, shape, basePosition=FAR_AWAY))
        with undone(lambda: self._client.removeBody(uid)):
            self._core.keep_apart(uid)
        return uid

    def _colour(self, uid: int, colours: NDArray[np.uint8]) -> None:
        """Give a body the colours (rows, columns, 3) of its samples."""
        image = _as_tga(colours)
        digest = hashlib.sha256(image).digest()
        if digest not in self._textures:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder, "ground.tga")
                file.write_bytes(image)
                self._textures[digest] = self._client.loadTexture(str(file))
        texture = self._textures[digest]
        self._client.changeVisualShape(uid, -1, textureUniqueId=texture, rgbaColor=(1.0,) * 4, specularColor=(0.0,) * 3)

    def _remove(self, name: str) -> None:
        if self._core.is_ground(self._tiles[name].uid):
            self._client.removeBody(self._tiles[name].uid)
        gone = self._tiles.pop(name)
        if gone.size is not None:
            self._unused.setdefault(gone.size, []).append(gone.shape)


def quarter_turn(yaw: float) -> Quaternion:
    """Orientation (x, y, z, w) of the body of a height field over a grid with a ``yaw`` [rad]: 90 degrees more, see
    `replace_heights`."""
    return about(Z, yaw + 0.5 * math.pi)


def make_shape(client: Any, rows: int, columns: int, spacing: float, bound: float) -> int:
    """Create the shape of a height field whose heights may later differ by ``bound`` [m] from its base.

    PyBullet never updates the bounds of a field whose heights are replaced (bullet3 issues 4200 and 4236), and ignores
    what is outside them.
    """
    heights = [0.0] * (rows * columns)
    heights[0], heights[-1] = -bound, bound
    return int(
        client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD, meshScale=[spacing, spacing, 1.0], heightfieldData=heights, numHeightfieldRows=rows,
            numHeightfieldColumns=columns,
        )
    )  # fmt: skip


def replace_heights(client: Any, shape: int, heights: FloatArray) -> None:
    """Replace the heights (rows, columns) [m] of a field above its base; PyBullet cannot change the size.

    The shape is rotated by 90 degrees from its grid, because PyBullet splits cells along the other diagonal than the
    main mesh, and the rotation makes the two agree (row r, column c of the grid is PyBullet's row columns - 1 - c,
    column r). PyBullet's first index runs along its x axis, although the argument is called columns.
    """
    rows, columns = heights.shape
    client.createCollisionShape(
        pb.GEOM_HEIGHTFIELD, heightfieldData=heights[:, ::-1].T.ravel().tolist(), numHeightfieldRows=rows,
        numHeightfieldColumns=columns, replaceHeightfieldIndex=shape,
    )  # fmt: skip


def _fits(shown: ShownTile, mesh: MainMesh) -> bool:
    """Return True if a tile can be drawn in place of the one that is shown."""
    if isinstance(mesh, HeightMap) and isinstance(shown.mesh, HeightMap):
        new, old = mesh.geometry, shown.mesh.geometry
        return (new.rows, new.columns, new.resolution) == (old.rows, old.columns, old.resolution)
    return shown.mesh is mesh


def _as_tga(pixels: NDArray[np.uint8]) -> bytes:
    """Return an image (height, width, 3), red, green and blue, as a file in the format TGA."""
    height, width, _ = pixels.shape
    header = bytes([0, 0, 2, *[0] * 9]) + np.array([width, height], "<u2").tobytes() + bytes([24, 0x20])
    return header + pixels[:, :, ::-1].tobytes()
