"""Terrain from topics: height maps, general meshes, updates of both, and the messages of the adapters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TerrainMesh, TerrainMeshUpdate

from smartmesh_ros.errors import InputError, naming
from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.io import files
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.inputs.adapters import ADAPTERS, occupancy_region
from smartmesh_ros.node.inputs.cdr_reader import (
    MOST_SAMPLES,
    RegionInput,
    Stamped,
    map_from,
    mesh_from,
    mesh_update_from,
    region_from,
)
from smartmesh_ros.node.inputs.deck_inputs import DeckInputs, Target
from smartmesh_ros.node.inputs.map_checks import MapChecks
from smartmesh_ros.node.inputs.optional_messages import class_of, find_class
from smartmesh_ros.node.inputs.source_clocks import SourceClocks
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.session import Session, require_name
from smartmesh_ros.node.timing.stamps import Placed, stamp_seconds
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.material import Material
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Frame of the terrain if the first map names none.
DEFAULT_FRAME = "map"
# Queue depths of the subscriptions to whole maps and to updates.
MAPS, UPDATES = 2, 100
# Most tiles; more are refused.
MOST_TILES = 1000


class TerrainInputs:
    """Applies terrain messages to the world's terrain and its ``decks``. Calls ``on_terrain`` after each."""

    def __init__(self, session: Session, decks: DeckInputs, on_terrain: Callable[[], None]) -> None:
        self._session, self._decks = session, decks
        self._terrain = session.world.terrain
        self._on_terrain = on_terrain
        self._clocks = SourceClocks(session)
        self._checks = MapChecks(session)
        settings = session.settings
        maps, updates = QoSProfile(depth=MAPS), QoSProfile(depth=UPDATES)
        before = len(session.subscriptions)
        session.listen(Heightmap, "heightmap", self._on_map, maps, raw=True)
        session.listen(
            HeightmapUpdate, "heightmap_update", lambda data: self._take_region(region_from(data)), updates, raw=True
        )
        session.listen(TerrainMesh, "terrain_mesh", self._on_mesh, maps, raw=True)
        session.listen(TerrainMeshUpdate, "terrain_mesh_update", self._on_mesh_update, updates, raw=True)
        if settings.input != "heightmap":
            name, convert = ADAPTERS[settings.input]
            kind = class_of(name, f"terrain.input {settings.input!r}")
            session.listen(kind, settings.input, partial(self._on_raster, convert), maps)
        if settings.input == "occupancy_grid" and (kind := find_class("map_msgs/msg/OccupancyGridUpdate")):
            session.listen(kind, "occupancy_grid_update", self._on_occupancy_update, updates)
        elif settings.input == "occupancy_grid":
            session.node.get_logger().info(
                "no ~/occupancy_grid_update: it needs map_msgs, which is not installed; apt install ros-jazzy-map-msgs"
            )
        session.terrain_subscriptions = session.subscriptions[before:]
        if settings.file:
            with naming("terrain.file"):
                self.load(files.load(settings.file, settings.raster, MOST_SAMPLES))

    def forget_stamps(self) -> None:
        self._clocks.clear()
        self._checks.forget()
        for name, tile in self._terrain.tiles.items():
            if isinstance(tile, HeightMap):
                self._checks.note_holes(name, tile)

    def _on_map(self, data: bytes) -> None:
        new = map_from(data)
        self._take_map("heightmap", new.start, lambda: new.raster)

    def _on_raster(self, convert: Callable[..., Raster], message: Any) -> None:
        settings = self._session.settings
        self._take_map(settings.input, _start_of(message.header), lambda: convert(message, settings.raster))

    def _take_map(self, topic: str, start: Stamped, convert: Callable[[], Raster | None]) -> None:
        """Checks a whole map and puts it into the terrain, or a deck of it; None removes the tile."""
        session, clock = self._session, self._clocks.of(_source(self._decks.target(start)))
        # A newer map arrived just before this one.
        if clock.is_overtaken(stamp_seconds(start), session.clock_now(), session.settings.motion.max_interval):
            session.counts[f"overtaken on {topic}"] += 1
            return
        with self._ingesting(start) as (target, placed):
            raster = convert()
            if raster is None:
                target.tiles.remove(target.tile)
                return
            taken = take_map(self._terrain, session.settings, target, raster, placed.time)
            self._checks.take(target.name, raster, taken, placed.source_time)

    def _on_occupancy_update(self, message: Any) -> None:
        settings = self._session.settings
        row, column, heights = occupancy_region(message, settings.raster)
        self._take_region(RegionInput(_start_of(message.header), row, column, heights, None))

    def _take_region(self, new: RegionInput) -> None:
        with self._ingesting(new.start, update=True) as (target, placed):
            tile = target.tiles.tile(target.tile)
            if not isinstance(tile, HeightMap):
                words = f"tile {new.start.name!r} is a general mesh; use ~/terrain_mesh_update"
                raise InputError("unknown_tile", words)
            time = max(placed.time, tile.time)  # of a source whose clock is behind that of another one
            require_soils(new.material, self._session.settings)
            tile.update_region(
                new.row, new.column, new.heights, time=time, velocities=new.velocities, material=new.material
            )
            self._checks.note_holes(target.name, tile, new.heights)

    def load(self, raster: Raster) -> None:
        """Takes the terrain of a file."""
        settings = self._session.settings
        self._take_map(settings.input, Stamped(0, 0, settings.frame_id, ""), lambda: raster)

    def clear(self) -> None:
        """Removes all maps and meshes, also those of decks."""
        for of in (self._terrain, *self._decks.decks.values()):
            for tile in list(of.tiles):
                of.remove(tile)
        self._checks.forget()
        self._session.maps.clear()
        self._session.last_map_time, self._session.frame_id = None, self._session.settings.frame_id

    def _on_mesh(self, data: bytes) -> None:
        settings = self._session.settings
        new = mesh_from(data)
        with self._ingesting(new.start) as (target, placed):
            if not len(new.vertices) and not len(new.triangles):
                target.tiles.remove(target.tile)
                return
            require_tile_fits(target, len(new.vertices), self._terrain)
            mesh = TriangleMesh(
                new.vertices, new.triangles, time=placed.time, velocities=new.velocities, motion=settings.motion
            )
            target.tiles.put(target.tile, mesh)

    def _on_mesh_update(self, data: bytes) -> None:
        new = mesh_update_from(data)
        with self._ingesting(new.start, update=True) as (target, placed):
            mesh = target.tiles.tile(target.tile)
            if not isinstance(mesh, TriangleMesh):
                raise InputError("unknown_tile", f"tile {new.start.name!r} is a height map; use ~/heightmap_update")
            time = max(placed.time, mesh.time)
            mesh.move(new.vertices, time=time, indices=new.indices, velocities=new.velocities)

    @contextmanager
    def _ingesting(self, start: Stamped, *, update: bool = False) -> Iterator[tuple[Target, Placed]]:
        """Checks the fields common to all terrain messages, and yields where they belong and the stamp in simulated
        time; records the message as accepted unless the block raises `InputError`."""
        session, target = self._session, self._decks.target(start)
        tiles, longest = target.tiles.tiles, session.settings.motion.max_interval
        with session.world.stopwatch.stage("ingest"):
            self._require_place(target, start, update=update)
            most = longest if update else 0.0
            with (
                self._clocks.placing(_source(target), stamp_seconds(start), most=most, horizon=longest) as placed,
                # Else the motion of the source during a stall of the loop would count as fast motion of the ground, and
                # so would a jump of its clock.
                _moved_on(tiles.get(target.tile), longest if placed.fresh else placed.lost),
            ):
                yield target, placed
            if target.tile in tiles:
                session.maps[target.name] += 1
                tiles[target.tile].delay = self._clocks.of(_source(target)).delay
            else:  # the message removed it; names of others may come without end
                self._clocks.pop(_source(target), None)
                session.maps.pop(target.name, None)
                self._checks.forget(target.name)
            if not target.frame:
                session.frame_id = session.frame_id or start.frame_id or DEFAULT_FRAME
            session.last_map_time = session.clock.steady()
        self._on_terrain()

    def _require_place(self, target: Target, start: Stamped, *, update: bool) -> None:
        """Raise `InputError` unless a message may be of its target: by its frame and, if it is an ``update``, because
        there is a map."""
        if update and not target.tiles.tiles:
            raise InputError("no_map", "an update came before any map; publish the whole map first")
        if not target.frame:
            self._session.require_frame(start.frame_id)
        elif start.frame_id not in ("", target.frame):
            words = f"frame {start.frame_id!r} is not that of the deck, {target.frame!r}"
            raise InputError("frame", f"{words}; maps of a deck are in its own frame")
        require_name(target.name)


@contextmanager
def _moved_on(mesh: MainMesh | None, lost: float) -> Iterator[None]:
    """Take a time [s] that was lost, negative if it was made up for, out of the past of a map for the block and after
    it; the past is as before if the block raises."""
    if mesh is None or not lost:
        yield
        return
    # What is blended in must not move into the future; it has no velocity.
    by = -max(lost, 0.0) if mesh.motion.corrects else -lost
    mesh.shift_time(by)
    with undone(partial(mesh.shift_time, -by)):
        yield


def _source(target: Target) -> str:
    """Return the name of a tile as a source of stamps."""
    return f"tile {target.name!r}" if target.name else "terrain"


def _start_of(header: Any) -> Stamped:
    """Return the first fields of a message that has no tile."""
    return Stamped(header.stamp.sec, header.stamp.nanosec, header.frame_id.strip("/"), "")


def require_tile_fits(target: Target, samples: int, terrain: Terrain) -> None:
    """Raises `InputError` if the terrain with this tile would have too many tiles, or too many samples in all tiles."""
    replaced: MainMesh | None = target.tiles.tiles.get(target.tile)
    others = [mesh for mesh in terrain.meshes if mesh is not replaced]
    if len(others) >= MOST_TILES:
        raise InputError("size", f"{len(others) + 1} tiles are more than {MOST_TILES}; remove some, or join them")
    total = samples + sum(mesh.size for mesh in others)
    if total > MOST_SAMPLES:
        raise InputError("size", f"{total} samples in all maps; at most {MOST_SAMPLES} are possible")


def require_soils(material: Material, settings: Settings) -> None:
    """Raises `InputError` if a material names a soil that is not in the list of the settings."""
    soil: Any = material.soil
    if soil is not None and settings.soil and soil.max() >= len(settings.soil):
        last = len(settings.soil) - 1
        raise InputError("soil", f"soils are up to {soil.max()}; they must be places in soil.type, 0 to {last}")


def take_map(terrain: Terrain, settings: Settings, target: Target, raster: Raster, time: float) -> HeightMap:
    """Puts a map of ``time`` [s] into the terrain, or a deck of it, and returns it.

    A map on the same grid replaces the heights of the last one, unless it is older, by its source's clock. If the grid
    moved, samples that both grids share keep their velocities. The ground keeps the layers of its material that the
    raster does not have. On `InputError` the terrain is unchanged.
    """
    geometry, heights, variances, material, velocities = raster
    require_soils(material, settings)
    known = target.tiles.tiles.get(target.tile)
    if isinstance(known, HeightMap) and known.geometry == geometry and time >= known.time:
        known.replace(heights, time=time, velocities=velocities, variance=variances, material=material)
        return known
    require_tile_fits(target, geometry.size, terrain)
    new = HeightMap(
        heights, geometry=geometry, time=time, velocities=velocities, variance=variances, material=material,
        motion=settings.motion,
    )  # fmt: skip
    target.tiles.put(target.tile, new)
    return new
