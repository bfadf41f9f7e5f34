"""The laws of moving ground, and that each mechanism is what makes them hold."""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, PatchConfig, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.patches.config import PatchKind
from smartmesh_ros.scenes.moving import InwardWaves, Wave
from smartmesh_ros.terrain.grid import GridGeometry

GRAVITY = 9.81


def flat(size: int = 121, resolution: float = 0.1) -> HeightMap:
    half = 0.5 * (size - 1) * resolution
    return HeightMap(np.zeros((size, size)), resolution=resolution, origin=(-half, -half))


def speed_along_a_gutter(kind: PatchKind) -> float:
    """Speed [m/s] of a frictionless ball after 8 s in a straight V gutter that it enters at 4 m/s."""
    heights = np.tile(0.05 * np.abs(np.arange(41) - 20)[:, None], (1, 361))
    heightmap = HeightMap(heights, resolution=0.1, origin=(-1.0, -2.0))
    config = WorldConfig(physics=PhysicsConfig(friction=0.0), patch=PatchConfig(kind=kind))
    with World(heightmap, config) as world:
        state = BodyState((0.0, 0.0, 0.15 * math.hypot(1.0, 0.5)), linear=(4.0, 0.0, 0.0))
        world.spawn("ball", Sphere(0.15), 1.0, state)
        world.step(8 * 240)
        return world.state("ball").linear[0]


def test_a_ball_keeps_its_speed_along_a_gutter() -> None:
    assert speed_along_a_gutter("auto") >= 3.99
    assert speed_along_a_gutter("heightfield") < 3.9, "inner edges hold it up"


def depth_in_pit() -> float:
    """How far a ball sinks when the one sample under it drops by a metre after its patch was made on flat ground."""
    heightmap = flat(41)
    config = WorldConfig(patch=PatchConfig(kind="heightfield"), physics=PhysicsConfig(guard=False))
    with World(heightmap, config) as world:
        world.spawn("ball", Sphere(0.3), 1.0, BodyState((0.0, 0.0, 0.3)))
        world.step(10)
        world.terrain.tiles[""].update_region(20, 20, [[-1.0]], time=10.0)
        world.step(240)
        return 0.3 - world.state("ball").position[2]


def test_ground_above_everything_seen_before_carries() -> None:
    """Heights are relative to the patch's centre sample: once that has dropped, all others are higher than any was when
    the collider was made (bullet3 issues 4200 and 4236)."""
    assert depth_in_pit() < 0.02


@pytest.mark.parametrize("rise", [1.0, 5.0, 20.0])
def test_a_body_is_carried_up_by_ground_far_above_where_it_started(rise: float) -> None:
    heightmap = flat(41)
    config = WorldConfig(patch=PatchConfig(kind="heightfield"), physics=PhysicsConfig(guard=False))
    with World(heightmap, config) as world:
        world.spawn("ball", Sphere(0.3), 1.0, BodyState((0.0, 0.0, 0.3)))
        for step in range(480):
            share = min(step / 240.0, 1.0)
            heightmap.replace(np.full((41, 41), rise * share), time=world.time)
            world.step()
        assert world.state("ball").position[2] >= rise + 0.29


class Launch(NamedTuple):
    """A ball on ground that rises from z = 0 and stops: its speed then, its apex, and how deep it sank while rising."""

    speed: float
    apex: float
    depth: float


def launch(speed: float, *, carry: bool = True) -> Launch:
    """Throws a ball by ground that rises at ``speed`` [m/s] for a second."""
    heightmap = flat(41)
    with World(heightmap, WorldConfig(patch=PatchConfig(carry_velocity=carry))) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.2)))
        rising, highest, depth, thrown = 240, 0.0, 0.0, 0.0
        for step in range(rising + 480):
            level = speed * min(step, rising) / 240.0
            heightmap.replace(np.full((41, 41), level), time=world.time)
            if 60 < step <= rising:  # at first it is hit by ground whose motion is not known yet
                depth = max(depth, level + 0.2 - world.state("ball").position[2])
            world.step()
            if step == rising:
                thrown = world.state("ball").linear[2]
            highest = max(highest, world.state("ball").position[2] - 0.2)
        return Launch(thrown, highest, depth)


@pytest.mark.parametrize("speed", [0.5, 2.0, 8.0])
def test_a_ball_on_ground_that_rises_and_stops_obeys_ballistics(speed: float) -> None:
    thrown = launch(speed)
    assert thrown.speed == pytest.approx(speed, rel=0.02)
    assert thrown.apex == pytest.approx(speed * 1.0 + speed**2 / (2.0 * GRAVITY), rel=0.02)
    assert thrown.depth < 5e-4


def test_without_carried_velocity_it_sinks_and_is_thrown_less_high() -> None:
    thrown = launch(2.0, carry=False)
    assert thrown.depth > 0.01
    assert thrown.apex < 2.0 + 2.0**2 / (2.0 * GRAVITY) - 0.01


class Ride(NamedTuple):
    """Spheres on waves: how many ended below the ground, and the 99th percentile of their penetration [m]."""

    lost: int
    depth: float


@cache
def ride(wave: Wave, *, carry: bool = True) -> Ride:
    """16 spheres of 0.2 m on the report's inward waves for 4 s, maps and physics at 240 Hz."""
    size, resolution = 121, 0.25
    half = 0.5 * (size - 1) * resolution
    scene = InwardWaves(GridGeometry(rows=size, columns=size, resolution=resolution, origin=(-half, -half, 0.0)), wave)
    heightmap = HeightMap(scene.heights(0.0), geometry=scene.geometry)
    rng = np.random.default_rng(5)
    depths = []
    with World(heightmap, WorldConfig(patch=PatchConfig(carry_velocity=carry))) as world:
        names = [f"ball_{index}" for index in range(16)]
        for name, (x, y) in zip(names, rng.uniform(-4.0, 4.0, (16, 2)).tolist(), strict=True):
            z = float(heightmap.at([[x, y]], 0.0).heights[0]) + 0.25
            world.spawn(name, Sphere(0.2), 1.0, BodyState((x, y, z)))
        for step in range(960):
            world.step()
            heightmap.replace(scene.heights(world.time), time=world.time)
            if step > 120:
                positions = np.array([world.state(name).position for name in names])
                depths.append(heightmap.at(positions[:, :2], world.time).heights - (positions[:, 2] - 0.2))
        return Ride(len(world.below_ground()), float(np.nanpercentile(depths, 99)))


def test_waves_carry_every_body_on_their_surface() -> None:
    slow, fast = ride(Wave(0.3, 1.0, 4.0)), ride(Wave(0.5, 1.5, 16.0))
    assert (slow.lost, fast.lost) == (0, 0)
    assert slow.depth < 0.004


def test_without_carried_velocity_they_do_not() -> None:
    assert ride(Wave(0.3, 1.0, 4.0), carry=False).depth > 0.003
    assert ride(Wave(0.5, 1.5, 16.0), carry=False).depth > 2.0 * ride(Wave(0.5, 1.5, 16.0)).depth


@pytest.mark.parametrize("make", [lambda: Sphere(0.25), lambda: Box(0.4, 0.3, 0.5)], ids=["sphere", "box"])
def test_a_body_that_falls_obeys_ballistics_until_it_rests(make: Callable[[], Sphere | Box]) -> None:
    shape = make()
    low = 0.25
    with World(flat(61)) as world:
        world.spawn("body", shape, 2.0, BodyState((0.0, 0.0, 1.25)))
        world.step(72)
        fallen = 0.3
        # Symplectic Euler falls g dt t / 2 further than the parabola.
        expected = 1.25 - 0.5 * GRAVITY * fallen**2 - 0.5 * GRAVITY * fallen / 240.0
        assert world.state("body").position[2] == pytest.approx(expected, abs=1e-6)
        world.step(240)
        assert world.state("body").position[2] == pytest.approx(low, abs=1e-3)
        force = sum(contact.normal_force for contact in world.contacts())
        assert force == pytest.approx(2.0 * GRAVITY, rel=0.01)


def test_a_ball_does_not_hang_on_contacts_of_ground_that_sank_away() -> None:
    """PyBullet keeps the contacts of a replaced heightfield; here all sinks but the sample it is placed by."""
    heightmap = flat()
    with World(heightmap, WorldConfig(patch=PatchConfig(kind="heightfield"))) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.04, 0.013, 0.2)))
        world.step(240)
        sunk = np.full((121, 121), -1.0)
        sunk[60, 60] = 0.0
        heightmap.replace(sunk, time=world.time)
        world.step(240)
        assert world.state("ball").position[2] < 0.1


@pytest.mark.parametrize("rate", [0.0, 60.0])
def test_ground_that_begins_to_fall_leaves_a_resting_ball_in_free_fall(rate: float) -> None:
    heightmap = HeightMap(np.zeros((21, 21)), resolution=0.25, origin=(-2.5, -2.5))
    with World(heightmap, WorldConfig(patch=PatchConfig(rate=rate))) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.01, 0.02, 0.2)))
        world.step(60)
        start, dt = world.time, world.config.physics.dt
        for _ in range(30):
            heightmap.replace(np.full((21, 21), -9.81 * (world.time - start) ** 2), time=world.time)
            world.step()
        fallen = world.time - start
        late = world.state("ball").linear[2] / -9.81 - fallen
        assert abs(late) <= 1.5 * dt


@pytest.mark.parametrize("rate", [0.0, 60.0])
@pytest.mark.parametrize("kind", ["heightfield", "auto"])
def test_a_ball_stays_on_a_seesaw_however_steep(kind: PatchKind, rate: float) -> None:
    """Ground rises and falls where it is; a collider that turns about a point aside would move into the ball."""
    across = 0.5 * (np.indices((41, 41))[1] - 20)
    with World(
        heightmap := HeightMap(0.0 * across, resolution=0.5, origin=(-10.0, -10.0, 0.0)),
        WorldConfig(patch=PatchConfig(kind=kind, rate=rate)),
    ) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.22, 0.2, 0.2)))
        for step in range(100):
            if step:
                heightmap.replace(0.8 * math.sin(3.0 * world.time) * across, time=world.time)
            world.step()
            slope, (x, _, z) = 0.8 * math.sin(3.0 * world.time), world.state("ball").position
            clearance = (z - slope * x) / math.hypot(1.0, slope) - 0.2
            assert step < 5 or abs(clearance) < 5e-4  # the ground's velocity is known after two maps
