"""Terrain from topics: height maps and their regions, general meshes and their moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from time import monotonic

from rclpy.qos import DurabilityPolicy, QoSProfile
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TerrainMesh, TerrainMeshUpdate

from smartmesh_ros.errors import InputError
from smartmesh_ros.node import conversions
from smartmesh_ros.node.pacing import StampClock
from smartmesh_ros.node.session import Session
from smartmesh_ros.physics.ground import require_usable
from smartmesh_ros.search.methods import ANYWHERE, require_search_on
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Frame of a terrain whose first map names none.
DEFAULT_FRAME = "map"


class TerrainInputs:
    """Takes terrain messages into the world's terrain. ``taken`` is called after each."""

    def __init__(self, session: Session, taken: Callable[[], None]) -> None:
        self._session = session
        self._terrain = session.world.terrain
        self._taken = taken
        self._clocks: dict[str, StampClock] = {}
        durability = DurabilityPolicy[session.settings.durability.upper()]
        maps = QoSProfile(depth=session.settings.map_depth, durability=durability)
        updates = QoSProfile(depth=session.settings.update_depth, durability=durability)
        session.listen(Heightmap, "heightmap", self._on_map, maps, raw=True)
        session.listen(HeightmapUpdate, "heightmap_update", self._on_region, updates, raw=True)
        session.listen(TerrainMesh, "terrain_mesh", self._on_mesh, maps, raw=True)
        session.listen(TerrainMeshUpdate, "terrain_mesh_update", self._on_mesh_update, updates, raw=True)

    def forget_stamps(self) -> None:
        """Accepts whatever stamps come next, after a reset."""
        self._clocks.clear()

    def _on_map(self, data: bytes) -> None:
        settings = self._session.settings
        new = conversions.map_from(data, settings.max_samples)
        stamp = conversions.stamp_seconds(new.start)
        with self._ingesting(new.start.tile, stamp, new.start.frame_id) as time:
            if new.geometry is None:
                self._terrain.remove(new.start.tile)
                return
            known = self._terrain.tiles.get(new.start.tile)
            if isinstance(known, HeightMap) and known.geometry == new.geometry:
                known.replace(new.heights, time=time, velocities=new.velocities)
            else:
                self._put(
                    new.start.tile,
                    HeightMap(
                        new.heights,
                        geometry=new.geometry,
                        time=time,
                        velocities=new.velocities,
                        motion=settings.motion,
                    ),
                )

    def _on_region(self, data: bytes) -> None:
        new = conversions.region_from(data, self._session.settings.max_samples)
        stamp = conversions.stamp_seconds(new.start)
        with self._ingesting(new.start.tile, stamp, new.start.frame_id, update=True) as time:
            tile = self._terrain.tile(new.start.tile)
            if not isinstance(tile, HeightMap):
                raise InputError(
                    "unknown_tile", f"tile {new.start.tile!r} is a general mesh; use ~/terrain_mesh_update"
                )
            tile.update_region(new.row, new.column, new.heights, time=time, velocities=new.velocities)

    def _on_mesh(self, data: bytes) -> None:
        settings = self._session.settings
        new = conversions.mesh_from(data, settings.max_samples)
        stamp = conversions.stamp_seconds(new.start)
        with self._ingesting(new.start.tile, stamp, new.start.frame_id) as time:
            if not len(new.vertices) and not len(new.triangles):
                self._terrain.remove(new.start.tile)
                return
            self._put(
                new.start.tile,
                TriangleMesh(new.vertices, new.triangles, time=time, velocities=new.velocities, motion=settings.motion),
            )

    def _on_mesh_update(self, data: bytes) -> None:
        settings = self._session.settings
        new = conversions.mesh_update_from(data, settings.max_samples)
        stamp = conversions.stamp_seconds(new.start)
        with self._ingesting(new.start.tile, stamp, new.start.frame_id, update=True) as time:
            mesh = self._terrain.tile(new.start.tile)
            if not isinstance(mesh, TriangleMesh):
                raise InputError("unknown_tile", f"tile {new.start.tile!r} is a height map; use ~/heightmap_update")
            method = settings.world.patch.search
            check = None if method in ANYWHERE else partial(require_search_on, method)
            mesh.move(new.vertices, time=time, indices=new.indices, velocities=new.velocities, check=check)

    def _put(self, tile: str, mesh: MainMesh) -> None:
        require_usable(self._session.settings.world.patch, mesh)
        self._terrain.put(tile, mesh)

    @contextmanager
    def _ingesting(self, tile: str, stamp: float | None, frame_id: str, *, update: bool = False) -> Iterator[float]:
        """Checks what all terrain messages have in common; gives the simulated time of the stamp, and notes the
        message as taken if the block refuses nothing."""
        session = self._session
        with session.world.stopwatch.stage("ingest"):
            if update and not self._terrain.tiles:
                raise InputError("no_map", "an update came before any map; publish the whole map first")
            if update:
                self._terrain.tile(tile)
            session.require_frame(frame_id)
            clock = self._clocks.get(tile) or StampClock()
            time = clock.place(stamp, session.clock_now(), session.time_now())
            yield time
            clock.accept(stamp, time)
            self._clocks[tile] = clock
            session.frame_id = session.frame_id or frame_id or DEFAULT_FRAME
            session.map_taken = monotonic()
        self._taken()
