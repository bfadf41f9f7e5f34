"""Bodies that sleep keep their contacts, and those that may move do not sleep."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, MotionConfig, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.ground.config import SleepConfig
from tests.grounds import end_of, level, shaped, world_of

SIDE, RATE = 61, 240
BOX = Box(0.2, 0.2, 0.2)


@contextmanager
def sleeping_box(ground: HeightMap) -> Iterator[World]:
    """A world whose box has fallen asleep on a level map."""
    with World(ground) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(RATE)
        assert asleep(world) == {"box"}
        yield world


def asleep(world: World) -> set[str]:
    """Names of the sleeping bodies."""
    return {name for name in world.bodies if world.is_asleep(name)}


def test_bodies_at_rest_sleep_and_keep_patches_contacts_and_wrenches() -> None:
    with World(level(SIDE)) as world:
        world.spawn("ball", Sphere(0.1), 2.0, BodyState((-1.0, 0.0, 0.1)))
        world.spawn("box", BOX, 3.0, BodyState((0.0, 0.0, 0.1)))
        world.spawn("can", Cylinder(radius=0.1, height=0.2), 4.0, BodyState((1.0, 0.0, 0.1)))
        world.step(60)
        assert not asleep(world)
        awake = world.patches().slots.tolist()
        touching = {contact.body for contact in world.contacts()}
        world.step(RATE)
        assert asleep(world) == {"ball", "box", "can"}
        assert world.patches().slots.tolist() == awake
        assert {contact.body for contact in world.contacts()} == touching == {"ball", "box", "can"}
        for wrench, mass in zip(world.wrenches(), (2.0, 3.0, 4.0), strict=True):
            assert wrench.force == pytest.approx([0.0, 0.0, 9.81 * mass], abs=0.02 * 9.81 * mass)
        points = world.client.getContactPoints()
        world.step()
        assert world.client.getContactPoints() == points, "nothing is collided anew"
        world.wake("box")
        world.step()
        assert asleep(world) == {"ball", "can"}
        world.configure(WorldConfig(physics=PhysicsConfig(sleep=False)))
        world.step(3 * RATE)
        assert not asleep(world), "without the setting none sleeps"
        assert world.state("box").position == pytest.approx((0.0, 0.0, 0.1), abs=1e-4)


def test_a_body_falls_asleep_only_with_all_that_it_may_touch() -> None:
    """A box beside one that spins in place stays awake, one apart from both sleeps."""
    with world_of(level(SIDE), friction=0.0) as world:
        world.spawn("spins", Cylinder(radius=0.1, height=0.2), 1.0, BodyState((0.0, 0.0, 0.1), angular=(0.0, 0.0, 2.0)))
        world.spawn("beside", BOX, 1.0, BodyState((0.204, 0.0, 0.1)))
        world.spawn("apart", BOX, 1.0, BodyState((1.0, 0.0, 0.1)))
        world.step(2 * RATE)
        assert asleep(world) == {"apart"}


def test_bodies_side_by_side_do_not_wake_one_another() -> None:
    """Their bounding spheres overlap, their boxes do not touch: once asleep they stay so."""
    with World(level(SIDE)) as world:
        for index in range(4):
            world.spawn(f"box_{index}", Box(0.4, 0.4, 0.1), 1.0, BodyState((0.43 * index, 0.0, 0.06 + 0.05 * index)))
        world.step(2 * RATE)
        for _ in range(RATE):
            assert len(asleep(world)) == 4
            world.step()


@pytest.mark.parametrize("moved", [1e-4, 3e-4])
def test_small_changes_of_the_ground_add_up(moved: float) -> None:
    """A change below the limit wakes none; many of them do, once they exceed it."""
    limit = SleepConfig().ground
    ground = level(SIDE, motion=MotionConfig(max_interval=0.1))
    with sleeping_box(ground) as world:
        for count in range(1, 20):
            ground.replace(np.full((SIDE, SIDE), count * moved), time=world.time)
            world.step(4)
            if not asleep(world):
                break
            assert count * moved <= limit
            world.step(60)
        assert count == math.floor(limit / moved + 1e-6) + 1


def test_what_is_changed_elsewhere_wakes_none() -> None:
    with sleeping_box(ground := level(SIDE)) as world:
        for step in range(240):
            if step % 4 == 0:
                ground.update_region(0, 0, np.full((20, 20), 0.1 * math.sin(step)), time=world.time)
            if step % 4 == 2:
                ground.replace(ground.heights, time=world.time)
            world.step()
            assert asleep(world) == {"box"}


def test_a_ball_rolls_down_a_slope_where_gravity_is_weak() -> None:
    """5/7 of what gravity has along the slope, from rest, and for so long as it takes for 1 m on the Earth's slope."""
    gravity, angle = 0.02, math.radians(3.0)
    seconds = math.sqrt(2.0 * 1.0 / (5.0 / 7.0 * gravity * math.sin(angle)))
    slope, start = shaped(lambda x, y: math.tan(angle) * x, SIDE), 2.0 * math.tan(angle) + 0.1 / math.cos(angle)
    end = end_of(slope, Sphere(0.1), BodyState((2.0, 0.0, start)), int(seconds * RATE), gravity=(0.0, 0.0, -gravity))
    assert end.position[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("after", [0.0, 0.02])
def test_a_body_at_its_apex_does_not_sleep_however_soon_others_do(after: float) -> None:
    with World(level(SIDE), WorldConfig(sleep=SleepConfig(after=after))) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.0, 0.0, 0.3), linear=(0.0, 0.0, 2.0)))
        world.spawn("rests", BOX, 1.0, BodyState((1.0, 0.0, 0.1)))
        for _ in range(RATE // 3):
            world.step()
            assert "ball" not in asleep(world)
        assert asleep(world) == {"rests"}
