"""A rover drives for a minute on the maps that an elevation mapper makes, through drift and three loop closures."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pybullet_data

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.world.world import World, WorldConfig
from studies.mapper.mapping import MapFrame, MappingConfig, mapped_terrain
from studies.mapper.truth import true_ground
from studies.matrix.row import METHODS, Row

HUSKY = str(Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf")
WHEELS = {f"{end}_{side}_wheel": side for end in ("front", "rear") for side in ("left", "right")}
WHEEL_RADIUS, TRACK = 0.165, 0.57  # of that robot [m]
# A rover that turns on the spot by its wheels' slip needs more than its kinematics say.
SLIP = 1.8
# The rover is put onto the map once it is known where it stands [s], and heads for where it is to be so much later [s].
START, AHEAD = 4.0, 1.0
STEP = 1.0 / 240.0
OTHERS = tuple(name for name in METHODS if name != "defaults")


class Drove(NamedTuple):
    """Contacts of a rover: maximum height above the true ground [mm], root mean square of their error of height and of
    the map's at the same places [mm], maximum vertical speed of the rover [m/s], and number of lost wheels."""

    above: float
    error: float
    of_map: float
    fastest: float
    lost: int


def take(terrain: Terrain, frame: MapFrame, motion: MotionConfig) -> None:
    """Takes a map as the node does: in place of the one before, or as that one moved by whole cells."""
    known = terrain.tiles.get("")
    if isinstance(known, HeightMap) and known.geometry == frame.geometry:
        known.replace(frame.elevation, time=frame.stamp)
    else:
        terrain.put("", HeightMap(frame.elevation, geometry=frame.geometry, time=frame.stamp, motion=motion))


def steer(world: World, target: tuple[float, float]) -> None:
    """Drives the wheels so that the rover is at a place (x, y) [m] in `AHEAD` seconds."""
    state = world.state("rover")
    x, y, z, w = state.orientation
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    dx, dy = target[0] - state.position[0], target[1] - state.position[1]
    off = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
    speed, turn = math.hypot(dx, dy) * math.cos(off) / AHEAD, SLIP * 2.0 * off / AHEAD
    for wheel, side in WHEELS.items():
        rim = speed + (0.5 if side == "right" else -0.5) * TRACK * turn
        world.drive("rover", wheel, rim / WHEEL_RADIUS)


def contacts(world: World) -> Iterator[tuple[float, float, float]]:
    """Where the rover touches the ground [m]."""
    for point in world.client.getContactPoints(bodyA=world.bodies["rover"].uid):
        if point[2] != point[1] and point[8] <= 0.0:
            yield point[6]


def drive(motion: MotionConfig, physics: PhysicsConfig, method: PatchConfig, mapping: MappingConfig) -> Drove:
    """Has a rover drive as the mapper's does, on the maps of that one."""
    ground: Surface = true_ground(mapping.truth)
    frames = list(frames_of(mapping))
    places, errors, of_map, fastest, lost = [], [], [], 0.0, set[str]()
    with World(config=WorldConfig(patch=method, physics=physics)) as world:
        world.time = frames[0].stamp
        for step in range(round((mapping.duration - frames[0].stamp) / STEP)):
            while frames and frames[0].stamp <= world.time + 1e-9:
                frame = frames.pop(0)
                take(world.terrain, frame, motion)
            if world.time < START:
                world.time += STEP
                continue
            if "rover" not in world.bodies:
                x, y, heading = mapping.path.at(world.time)
                z = float(world.terrain.at([[x, y]], world.time).heights[0]) + 0.15
                turned = (0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
                world.spawn_robot("rover", HUSKY, BodyState((x, y, z), turned))
            if step % 24 == 0:
                steer(world, mapping.path.at(world.time + AHEAD)[:2])
            world.step()
            if world.time < START + 1.0:
                continue
            fastest = max(fastest, abs(world.state("rover").linear[2]))
            if step % 8 == 0:
                lost.update(world.below_ground())
                found = np.array(list(contacts(world))).reshape(-1, 3)
                over = found[:, 2] - ground.below(found)
                told = Surface(frame.geometry, np.asarray(frame.elevation, np.float64)).below(found)
                places += over.tolist()
                known = ~np.isnan(told)
                errors += over[known].tolist()
                of_map += (told - found[:, 2] + over)[known].tolist()
    error, error_of_map = (1e3 * float(np.sqrt(np.nanmean(np.square(values)))) for values in (errors, of_map))
    return Drove(1e3 * float(np.nanmax(places)), error, error_of_map, fastest, len(lost))


@cache
def frames_of(mapping: MappingConfig) -> tuple[MapFrame, ...]:
    """The maps of a drive."""
    return tuple(mapped_terrain(mapping))


@cache
def driven(method: PatchConfig) -> Drove:
    """The drive with corrections."""
    return drive(MotionConfig(changes="correction"), PhysicsConfig(), method, MappingConfig())


def measured(measure: str, method: PatchConfig) -> float:
    """A figure of the drive."""
    found = driven(method)
    return found.error / found.of_map if measure == "error" else float(getattr(found, measure))


ROWS = tuple(
    Row(
        name=f"on a mapper's maps for a minute: {name}",
        figure=partial(measured, measure),
        limit=limit,
        unit=unit,
        source=source,
        skip=OTHERS,
    )
    for measure, name, limit, unit, source in (
        ("above", "highest over the true ground", 50.0, "mm", "the maps' drift"),
        ("error", "error of height at contacts, of the map's", 1.2, "-", "as good as the map"),
        ("lost", "wheels lost", 0.0, "wheels", "none"),
    )
)
