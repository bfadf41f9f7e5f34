"""Scenes of bodies that fall asleep, played in worlds that sleep and in worlds that never do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.world.world import World, WorldConfig

SIDE, SPACING = 41, 0.1
MIDDLE = 0.5 * (SIDE - 1) * SPACING
RATE, MAPS = 240, 60.0  # steps and maps in a second
SETTLED = 480  # steps until bodies are asleep
FLAT = np.zeros((SIDE, SIDE), np.float32)

Build = Callable[[World], None]
# Called before each step after the bodies slept: with the world and the number of the step.
Event = Callable[[World, int], None]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Bodies that come to rest on level ground, and what then happens to them for a number of ``steps``."""

    build: Build
    event: Event
    steps: int = 480
    motion: MotionConfig = field(default_factory=MotionConfig)


def ground_of(heights: Any, motion: MotionConfig | None = None) -> HeightMap:
    """A map of ``heights`` (rows, columns) [m] around the origin."""
    return HeightMap(heights, resolution=SPACING, origin=(-MIDDLE, -MIDDLE), motion=motion)


def slope_of(angle: float) -> HeightMap:
    """Ground that rises along x at an ``angle`` [rad]."""
    return ground_of(np.tile(math.tan(angle) * SPACING * np.arange(SIDE), (SIDE, 1)).astype(np.float32))


def map_of(world: World) -> HeightMap:
    """The only map of a world."""
    ground = world.terrain.tiles[""]
    assert isinstance(ground, HeightMap)
    return ground


def play(scene: Scene, method: PatchConfig, *, sleep: bool) -> list[dict[str, FloatArray]]:
    """Play a scene and return the positions [m] of all bodies by name after each step of the event. In a sleeping world
    all bodies must be asleep before it; raises `InputError` if they are not."""
    ground = ground_of(FLAT, scene.motion)
    config = WorldConfig(physics=PhysicsConfig(sleep=sleep), patch=method)
    path = []
    with World(Terrain(ground), config) as world:
        scene.build(world)
        world.step(SETTLED)
        awake = [follower.name for follower in world.followers if follower.slot in world.followers.solid]
        if sleep and awake:
            raise InputError("method", f"these bodies did not fall asleep: {', '.join(awake)}")
        for step in range(scene.steps):
            scene.event(world, step)
            world.step()
            path.append({name: np.array(world.state(name).position) for name in world.bodies})
    return path


def astray(scene: Scene, method: PatchConfig) -> float:
    """Largest distance [mm] of any body from its place in a world that never sleeps, at the end; infinite if one is
    lost."""
    asleep, awake = play(scene, method, sleep=True)[-1], play(scene, method, sleep=False)[-1]
    if asleep.keys() != awake.keys():
        return math.inf
    return 1e3 * max(math.dist(asleep[name].tolist(), awake[name].tolist()) for name in awake)


def deeper(scene: Scene, method: PatchConfig) -> float:
    """How much lower [mm] the lowest body gets than in a world that never sleeps."""
    lowest = [
        min(positions[2] for places in play(scene, method, sleep=sleep) for positions in places.values())
        for sleep in (True, False)
    ]
    return float(1e3 * max(lowest[1] - lowest[0], 0.0))


def ball_and_box(world: World) -> None:
    """A ball and a box apart from one another."""
    world.spawn("ball", Sphere(0.1), 1.0, BodyState((-0.5, 0.02, 0.1)))
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.5, 0.03, 0.1)))


def pile(count: int) -> Build:
    """Boxes in columns of five, side by side."""

    def build(world: World) -> None:
        for index in range(count):
            column, level = divmod(index, 5)
            x, y = divmod(column, 4)
            place = (0.21 * x, 0.21 * y, 0.1 + 0.2 * level)
            world.spawn(f"box_{index}", Box(0.2, 0.2, 0.2), 1.0, BodyState(place))

    return build


def changed_map(change: Callable[[float], Any], *, region: bool = False) -> Event:
    """Maps, or regions in the middle, at the maps' rate: heights [m] by the time since the event began [s]."""

    def event(world: World, step: int) -> None:
        ground = map_of(world)
        if step % round(RATE / MAPS) == 0:
            heights = change(step / RATE).astype(np.float32)
            if region:
                ground.update_region(8, 8, heights[8:33, 8:33], time=world.time)
            else:
                ground.replace(heights, time=world.time)

    return event


def rise(height: float, speed: float) -> Callable[[float], Any]:
    """Ground that rises by a ``height`` [m] at a ``speed`` [m/s] and stays there."""
    return lambda time: FLAT + np.float32(min(speed * (time + 1.0 / MAPS), height))


def once(act: Callable[[World], None]) -> Event:
    """Do something before the first step."""

    def event(world: World, step: int) -> None:
        if step == 0:
            act(world)

    return event
