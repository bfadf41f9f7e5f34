"""Rows on sleeping bodies, each beside a world that never sleeps: none is lost, and they end where they do awake."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.states import simulated_states
from smartmesh_ros.world.world import World, WorldConfig
from studies.matrix.arena import HUSKY
from studies.matrix.row import Row
from studies.matrix.sleep_scenes import (
    FLAT,
    MIDDLE,
    RATE,
    SETTLED,
    Scene,
    astray,
    ball_and_box,
    changed_map,
    deeper,
    ground_of,
    map_of,
    once,
    pile,
    play,
    rise,
    slope_of,
)


def rises(method: PatchConfig) -> float:
    """Ground rises by 0.1 to 300 mm at 0.05 to 3 m/s, by maps and by regions: the worst of all."""
    worst = 0.0
    for height in (1e-4, 1e-3, 0.01, 0.3):
        for speed in (0.05, 3.0):
            for region in (False, True):
                event = changed_map(rise(height, speed), region=region)
                worst = max(worst, astray(Scene(build=ball_and_box, event=event), method))
    return worst


def dug_away(method: PatchConfig) -> float:
    """The ground under both bodies is dug away by 0.2 m at once."""
    heights = FLAT.copy()
    heights[12:29, 12:29] = -0.2
    return astray(Scene(build=ball_and_box, event=changed_map(lambda _: heights)), method)


def hole(method: PatchConfig) -> float:
    """The ground under both bodies is gone: they fall as far as awake ones."""
    heights = FLAT.copy()
    heights[12:29, 12:29] = np.nan
    return astray(Scene(build=ball_and_box, event=changed_map(lambda _: heights), steps=60), method)


def no_tile(method: PatchConfig) -> float:
    """The only tile is removed: they fall as far as awake ones."""
    event = once(lambda world: world.terrain.remove(""))
    return astray(Scene(build=ball_and_box, event=event, steps=60), method)


def slide(method: PatchConfig) -> float:
    """The ground starts to slide at 0.3 m/s, as a belt does."""

    def start(world: World) -> None:
        ground = map_of(world)
        ground.replace(FLAT, time=world.time)
        ground.slide((0.3, 0.0), 0.5)

    return astray(Scene(build=ball_and_box, event=once(start), steps=240), method)


def corrected(method: PatchConfig) -> float:
    """The map is corrected by 5 cm."""
    motion = MotionConfig(changes="correction")
    return astray(Scene(build=ball_and_box, event=changed_map(lambda _: FLAT + 0.05), motion=motion), method)


def bottom_taken(method: PatchConfig) -> float:
    """The lowest box of a column of five is removed: error [mm] of the heights that the others come to rest at."""
    ends = play(Scene(build=pile(5), event=once(lambda world: world.remove("box_0"))), method, sleep=True)[-1]
    return 1e3 * float(max(abs(ends[f"box_{level + 1}"][2] - 0.1 - 0.2 * level) for level in range(4)))


def pile_of_fifty(method: PatchConfig) -> float:
    """The ground under ten columns of five boxes rises by 2 cm."""
    return astray(Scene(build=pile(50), event=changed_map(rise(0.02, 0.1))), method)


def hit(method: PatchConfig) -> float:
    """A box is hit by a ball of its mass at 0.5 to 40 m/s, from the side and from above: how much deeper it gets than
    awake."""
    worst = 0.0
    for speed in (0.5, 5.0, 40.0):
        for start, velocity in (((-1.0, 0.03, 0.12), (speed, 0.0, 0.0)), ((0.5, 0.03, 1.0), (0.0, 0.0, -speed))):

            def throw(world: World, start: Any = start, velocity: Any = velocity) -> None:
                world.spawn("thrown", Sphere(0.1), 1.0, BodyState(start, linear=velocity))

            worst = max(worst, deeper(Scene(build=box_alone, event=once(throw), steps=120), method))
    return worst


def box_alone(world: World) -> None:
    """One box."""
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.5, 0.03, 0.1)))


def spawn_husky(world: World, x: float) -> None:
    """A robot with its brakes on; PyBullet lets it roll on flat ground otherwise."""
    world.spawn_robot("husky", HUSKY, BodyState((x, 0.0, 0.15)))
    for joint in world.bodies["husky"].joints:
        world.command("husky", joint, JointCommand(velocity=0.0))


def robot_pushes(method: PatchConfig) -> float:
    """A robot drives into a row of three boxes: how far the farthest ends from its place in a world that never
    sleeps."""

    def build(world: World) -> None:
        spawn_husky(world, -1.2)
        for index in range(3):
            world.spawn(f"box_{index}", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.4 + 0.31 * index, 0.0, 0.15)))

    def drive(world: World) -> None:
        for joint in world.bodies["husky"].joints:
            if "wheel" in joint:
                world.command("husky", joint, JointCommand(velocity=5.0))

    scene = Scene(build=build, event=once(drive), steps=480)
    asleep, awake = (play(scene, method, sleep=sleep)[-1]["box_2"] for sleep in (True, False))
    return 1e3 * math.dist(asleep, awake)


def joint_commanded(method: PatchConfig) -> float:
    """A robot at rest gets a joint command."""

    def drive(world: World) -> None:
        for joint in world.bodies["husky"].joints:
            world.command("husky", joint, JointCommand(velocity=2.0))

    return astray(Scene(build=lambda world: spawn_husky(world, 0.0), event=once(drive), steps=240), method)


def gravity_turns(method: PatchConfig) -> float:
    """Gravity tilts so far that both bodies slide."""

    def turn(world: World) -> None:
        physics = PhysicsConfig(sleep=world.config.physics.sleep, gravity=(7.0, 0.0, -7.0))
        world.configure(WorldConfig(physics=physics, patch=method))

    return astray(Scene(build=ball_and_box, event=once(turn), steps=60), method)


def guest_comes(method: PatchConfig) -> float:
    """A remote ball rolls into the box."""
    with World(ground_of(FLAT)) as other:
        other.spawn("guest", Sphere(0.1), 1.0, BodyState((-0.3, 0.03, 0.1), linear=(2.0, 0.0, 0.0)))
        path = []
        for _ in range(120):
            path.append(simulated_states(other))
            other.step()

    def come(world: World, step: int) -> None:
        world.guests.take("other", path[min(step, len(path) - 1)], world.time)

    return astray(Scene(build=box_alone, event=come, steps=120), method)


def noise(method: PatchConfig) -> float:
    """Share of the time [%] that bodies are awake on maps with noise of 5 mm at 10 Hz that are fused, after the first
    minute of two."""
    rng = np.random.default_rng(7)
    ground = ground_of(FLAT, MotionConfig(changes="correction", noise=0.005))
    with World(ground, WorldConfig(patch=method)) as world:
        for index in range(4):
            world.spawn(f"box_{index}", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.8 * index - 1.2, 0.03, 0.1)))
        awake = 0
        for step in range(120 * RATE):
            if step % (RATE // 10) == 0:
                ground.replace(FLAT + rng.normal(0.0, 0.005, FLAT.shape).astype(np.float32), time=world.time)
            world.step()
            if step >= 60 * RATE:
                awake += len(world.followers.solid)
        return 100.0 * awake / (60 * RATE * len(world.followers))


def long_on_slope(method: PatchConfig) -> float:
    """How far [mm] a box creeps on a slope of 25 degrees in an hour, once it is asleep."""
    with World(slope_of(math.radians(25.0)), WorldConfig(physics=PhysicsConfig(friction=0.7), patch=method)) as world:
        half = 0.5 * math.radians(25.0)
        height = MIDDLE * math.tan(2.0 * half) + 0.1 / math.cos(2.0 * half)
        turn = (0.0, -math.sin(half), 0.0, math.cos(half))
        world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 0.0, height), turn))
        world.step(SETTLED)
        start = world.state("box").position
        world.step(3600 * RATE)
        return 1e3 * math.dist(start, world.state("box").position)


def rolls_on(method: PatchConfig) -> float:
    """Distance [mm] of a ball that rolls down a slope of 0.5 degrees for 3 s from its place in a world that never
    sleeps."""
    angle = math.radians(0.5)
    ends = []
    for sleep in (True, False):
        with World(slope_of(-angle), WorldConfig(physics=PhysicsConfig(sleep=sleep), patch=method)) as world:
            height = -math.tan(angle) * (MIDDLE - 1.0) + 0.1 / math.cos(angle)
            world.spawn("ball", Sphere(0.1), 1.0, BodyState((-1.0, 0.0, height)))
            world.step(3 * RATE)
            ends.append(world.state("ball").position)
    return 1e3 * math.dist(*ends)


SOURCE = "a world that never sleeps"
# Where bodies tumble against one another, two runs differ by centimetres whatever sleeps.
CHAOS = "a world that never sleeps; chaos"

ROWS = (
    Row("sleep: ground rises", rises, 1.0, "mm", SOURCE),
    Row("sleep: dug away", dug_away, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: a hole", hole, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: its tile goes", no_tile, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: slides", slide, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: corrected", corrected, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: bottom taken", bottom_taken, 1.0, "mm", "geometry", quick=True),
    Row("sleep: pile of 50", pile_of_fifty, 5.0, "mm", CHAOS),
    Row("sleep: hit", hit, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: robot pushes", robot_pushes, 50.0, "mm", CHAOS),
    Row("sleep: joint commanded", joint_commanded, 5.0, "mm", CHAOS, quick=True),
    Row("sleep: gravity turns", gravity_turns, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: guest comes", guest_comes, 1.0, "mm", SOURCE, quick=True),
    Row("sleep: fused noise", noise, 50.0, "%", "asleep most of the time"),
    Row("sleep: an hour on 25 degrees", long_on_slope, 0.0, "mm", "Coulomb"),
    Row("sleep: rolls on 0.5 degrees", rolls_on, 0.0, "mm", SOURCE, quick=True),
)
