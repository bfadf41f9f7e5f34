"""Worlds refuse what cannot be, and track, drive and reset bodies."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import (
    Base,
    BaseConfig,
    BodyState,
    Carrier,
    Ground,
    HeightScan,
    HeightScanner,
    Imu,
    InputError,
    JointCommand,
    PhysicsConfig,
    World,
    WorldConfig,
)
from smartmesh_ros.ground.shapes import Box, Hull, Sphere
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.world.link_frames import LinkFrames
from tests import urdfs
from tests.grounds import level, moving

NOBODY = "unknown_body: there is no body []; known: 'ball'"


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda w: w.spawn("ball", Sphere(0.1), 1.0), "duplicate_id: "),
        *(
            (partial(World.spawn, name=name, shape=Sphere(0.1), mass=1.0), "empty_id: ")
            for name in ("", " ", "a/b", "a\nb", 7)
        ),
        (lambda w: w.track("a\x00b", 0.1, BodyState()), "empty_id: "),
        (lambda w: w.height_scan("ball", "isaac_lab"), "height_scan: "),
        (lambda w: HeightScanner(w, "ball", "isaac_lab"), "height_scan: "),
        (lambda w: Imu(w, "ball", config=100.0), "imu: "),
        (lambda _: Imu(None, "ball"), "world of an IMU is None"),
        (lambda _: Base(None, "ball", BaseConfig(wheels=("a", "b"))), "world of a base is None"),
        (lambda w: Base(w, "ball", "husky"), "base: "),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, align=True), "parameter: "),
        (lambda w: w.spawn_robot("x", urdfs.HUSKY, clearance=0.1), "parameter: "),
        (lambda w: w.spawn("x", Sphere(0.1), 0.0), "geometry: "),
        (lambda w: w.spawn("x", Box(0.1, math.inf, 0.1), 1.0), "geometry: "),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, BodyState((math.nan, 0.0, 0.0))), "non_finite: "),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, BodyState(orientation=(0.0, 0.0, 0.0, 0.0))), "quaternion: "),
        (lambda w: w.spawn_robot("x", "/no/such.urdf"), "urdf: "),
        *(
            (partial(World.spawn, name="x", shape=shape, mass=1.0), "pass Sphere, Box, Cylinder or Capsule")
            for shape in ("ball", Hull(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))))
        ),
        (lambda w: w.spawn("x", Sphere(0.1), "heavy"), "mass of 'x' is heavy kg"),
        (lambda w: w.spawn("x", Sphere(0.1), math.inf), "mass of 'x' is inf kg; it must be finite"),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, (0.0, 0.0, 1.0)), "pass BodyState(position, ...)"),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, on_ground=True, clearance="some"), "clearance is 'some'"),
        (lambda w: w.track("x", "ball", BodyState()), "radius of the sphere is ball m"),
        (lambda w: w.spawn_robot("x", 5), "type int; pass the text or the path of a URDF"),
        (lambda w: w.configure(PhysicsConfig()), "must be WorldConfig(physics="),
        *(
            (partial(act, steps), f"steps: the number of steps is {steps!r}; it must be a whole number from 0 on")
            for act in (lambda steps, w: w.step(steps), lambda steps, w: w.skip(steps))
            for steps in (-1, None, 1.5, True)
        ),
        (lambda w: w.periods(math.nan), "the rate is nan; it must be finite"),
        (lambda w: w.state([]), NOBODY),
        (lambda w: w.wake([]), NOBODY),
        (lambda w: w.remove([]), NOBODY),
        (lambda w: w.move([], BodyState()), NOBODY),
        (lambda w: w.drive([], "axle", 1.0), NOBODY),
        (lambda w: w.height_scan([[]], HeightScan()), NOBODY),
        (lambda w: w.cast_rays([(0, 0, 1)], [(0, 0, -1)], 2.0, through=[[]]), NOBODY),
        (lambda w: w.track([], 0.1, BodyState()), "empty_id: "),
        (lambda w: Imu(w, []), "empty_id: "),
        (lambda w: Base(w, [], BaseConfig(wheels=("a", "b"))), "empty_id: "),
        (lambda w: w.drive("ball", [], 1.0), "unknown_joint: "),
        (lambda w: w.carry([], Carrier("ball")), "a tile or deck is []; it must be a text"),
        (lambda w: w.carry("deck", Carrier([])), "Carrier(body, ...) with names"),
        (lambda w: w.carry("deck", Carrier("ball", link=[])), "Carrier(body, ...) with names"),
        (lambda w: w.save([]), "the file of a state is []; it must be a path"),
        (lambda w: w.height_scan(5, HeightScan()), "there is no body 5"),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, on_ground="x"), "on_ground is 'x'; it must be True or False"),
        (lambda w: w.spawn("x", Sphere(0.1), 1.0, on_ground=True, align="x"), "align is 'x'; it must be True or False"),
        (lambda _: World(stopwatch=5), "the stopwatch is 5; it must be Stopwatch(...)"),  # type: ignore[arg-type]
        (lambda _: World(config=0), "settings is 0; it must be WorldConfig("),  # type: ignore[arg-type]
        (lambda w: Ground(w.client, level(), 0), "the stopwatch is 0"),  # type: ignore[arg-type]
        (lambda w: HeightScanner(None, "ball", HeightScan()), "scanner is None; it must be a World"),  # type: ignore[arg-type]
        (lambda w: w.drive_surface("ball", "", "fast"), "speed of a surface is 'fast'"),  # type: ignore[arg-type]
        (lambda w: w.ground.drive(0, -1, "up", 1.0), "axis of a surface is 'up'"),  # type: ignore[arg-type]
        (lambda _: PhysicsConfig(sleep="x"), "sleep is 'x'; it must be True or False"),
        (lambda _: PhysicsConfig(rate=5e-324), "rate is 5e-324; it must be finite"),
        (lambda w: w.restore(None), "the saved state is None; pass its bytes or its file"),
        (lambda w: w.move("ball", BodyState((1e8, 0.0, 0.0))), "position: "),
        (lambda w: w.move("ball", BodyState(angular=(0.0, 0.0, 1e200))), "angular_velocity: "),
        (lambda w: w.state("nobody"), "unknown_body: "),
        (lambda w: w.drive("ball", "axle", 1.0), "unknown_joint: "),
        (lambda w: w.track("ball", 0.1, BodyState()), "duplicate_id: "),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_changes(world: World, act: Callable[[World], None], words: str) -> None:
    """By a reason or by words."""
    world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.2)))
    bodies = world.client.getNumBodies()
    with pytest.raises(InputError) as error:
        act(world)
    assert words in f"{error.value.reason}: {error.value}"
    assert list(world.bodies) == ["ball"]
    assert world.client.getNumBodies() == bodies
    world.step(10)
    assert world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(("count", "words"), [(1, "1 body not back"), (2, "2 bodies not back")])
def test_bodies_that_pybullet_does_not_reset_are_counted(count: int, words: str) -> None:
    with World(level(11)) as world:
        for number in range(count):
            world.spawn(f"ball {number}", Sphere(0.1), 1.0)
        world.client.disconnect()
        with pytest.raises(pb.error, match=words):
            world.reset()


def test_a_closed_world_says_that_it_is_closed_and_leaves_the_time_of_its_ground() -> None:
    ground = level(11)
    world = World(ground)
    world.step(24)
    ground.replace(ground.heights, time=world.time)
    world.spawn("ball", Sphere(0.2), 1.0)
    world.track("tracked", 0.2, BodyState((1.0, 1.0, 1.0)))
    world.close()
    world.close()
    for ask in (
        world.step, world.update, world.contacts, world.patches, world.save, partial(world.state, "ball"),
        partial(world.spawn, "other", Sphere(0.2), 1.0), partial(world.spawn_robot, "rover", urdfs.ROVER),
        partial(world.track, "tracked", 0.2, BodyState()), partial(world.move, "ball", BodyState()),
        partial(world.remove, "ball"), world.reset, partial(world.reset, 1), world.reset_time, world.clear,
    ):  # fmt: skip
        with pytest.raises(InputError, match="this world is closed; make another"):
            ask()
    assert ground.time == pytest.approx(0.1)


def test_a_tracked_body_that_is_not_heard_of_goes_no_farther(world: World) -> None:
    """However long its time-out is: its last velocity says nothing about so much later."""
    tracking = Tracking(world, timeout=60.0)
    tracking.update("rover", 0.3, BodyState((0.0, 0.0, 0.3), linear=(0.5, 0.0, 0.0)), 10.0)
    places = []
    for step in range(480):
        assert tracking.expire(10.0 + step / 240.0) == []
        world.step()
        places.append(world.state("rover").position[0])
    assert places[-1] == pytest.approx(0.25, abs=0.005)
    assert world.state("rover").linear == (0.0, 0.0, 0.0)
    tracking.update("rover", 0.3, BodyState((1.0, 0.0, 0.3), linear=(0.5, 0.0, 0.0)), 12.0)
    world.step(24)
    assert world.state("rover").position[0] == pytest.approx(1.05, abs=0.005)


def test_bodies_ride_on_the_ground_although_steps_are_skipped() -> None:
    """By what the ground rises while the ball stands still, less what the solver makes good since."""
    skipped, rise = 3, 0.3
    with World(level()) as world:
        world.spawn("ball", Sphere(0.15), 1.0, BodyState((0.0, 0.0, 0.15)))
        for step in moving(world, lambda time: rise * time, 276, every=12):
            if step >= 36:  # the velocity of the ground is known
                height = world.state("ball").position[2] - 0.15
                assert height > rise * (world.time - skipped * world.dt) - 5e-4
                world.skip(skipped if step % 5 == 0 else 0)
        assert world.time == pytest.approx((276 + 48 * skipped) * world.dt)


def test_settings_change_while_bodies_rest(world: World) -> None:
    world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.2)))
    world.step(480)
    assert world.is_asleep("ball")
    world.configure(WorldConfig(physics=PhysicsConfig(rate=480.0, gravity=(0.0, 0.0, -1.6))))
    time = world.time
    world.step(480)
    assert world.time == pytest.approx(time + 1.0)
    assert world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)
    assert sum(contact.normal_force for contact in world.contacts()) == pytest.approx(1.6, rel=0.02)


@pytest.mark.parametrize("kind", [np.array, list, lambda numbers: np.array(numbers, np.float32)])
def test_states_of_arrays_are_those_of_tuples_and_are_saved(kind: Callable[[Any], Any]) -> None:
    """Two worlds are in the same state if their numbers are the same, whatever these were given as."""
    found = []
    for each in (tuple, kind):
        state = BodyState(each((2.0, 2.0, 1.0)), each((0.0, 0.0, 0.0, 1.0)), each((1.0, 0.0, 0.0)))
        physics = PhysicsConfig(gravity=each((0.0, 0.0, -5.0)))
        with World(level(), WorldConfig(physics=physics)) as world:
            world.spawn("ball", Sphere(0.25), 1.0, state)
            world.step(3)
            world.restore(world.save())
            assert world.config.physics == PhysicsConfig(gravity=(0.0, 0.0, -5.0))
            found.append(world.snapshot())
    assert found[0] == found[1] and found[0].hash == found[1].hash


def test_robots_come_from_paths_and_seeds_and_radii_from_numpy() -> None:
    file = Path(urdfs.ROVER)
    with World(level()) as world:
        world.spawn_robot("rover", file, on_ground=True)
        world.track("walker", np.float32(0.25), BodyState((1.0, 1.0, 0.5)))
        world.replace_robot("rover", file)
        world.reset(seed=np.int64(7))
        world.restore(world.save())
        assert world.seed == 7 and world.bodies["walker"].shape == Sphere(0.25)


def test_contacts_and_wrenches_are_the_same_whichever_body_bullet_names_first(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.spawn("crate", Box(0.3, 0.3, 0.2), 2.0, BodyState((0.5, 0.0, 0.1), (0, 0, 0, 1), (1.0, -0.5, 0.0), (0, 0, 5)))
    world.step(10)
    (wrench,), contacts, points = world.wrenches(), world.contacts(), world.client.getContactPoints()
    assert np.all(np.abs(wrench.force) > 1.0) and np.any(np.abs(wrench.torque) > 0.05)
    turned = [
        (p[0], p[2], p[1], p[4], p[3], p[6], p[5], *(-np.array(v) if isinstance(v, tuple) else v for v in p[7:]))
        for p in points
    ]
    monkeypatch.setattr(world.client, "getContactPoints", lambda: turned)
    (found,) = world.wrenches()
    assert np.allclose([found.force, found.torque], [wrench.force, wrench.torque], rtol=0.0, atol=1e-12)
    assert world.contacts() == contacts


def test_a_ball_that_rolls_freely_meets_no_torque() -> None:
    with World(level()) as world:
        world.spawn(
            "ball", Sphere(0.3), 10.0, BodyState((0.0, 0.0, 0.3), linear=(2.0, 0.0, 0.0), angular=(0, 2 / 0.3, 0))
        )
        world.step(10)
        (wrench,) = world.wrenches()
        assert world.state("ball").linear == pytest.approx((2.0, 0.0, 0.0), abs=1e-9)
        assert wrench.force == pytest.approx((0.0, 0.0, 98.1), abs=1e-6)
        assert wrench.torque == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_wrenches_are_at_the_links_and_change_nothing_whoever_reads_them() -> None:
    with World(level()) as world, World(level()) as unread:
        for each in (world, unread):
            each.spawn_robot("rover", urdfs.ROVER, on_ground=True)
            for joint in each.joints("rover"):
                each.command("rover", joint.name, JointCommand(velocity=10.0))
            each.step(100)
        for _ in range(20):
            for each in (world, unread):
                each.step()
            wrenches, uid = world.wrenches(), world.bodies["rover"].uid
            links = LinkFrames(world.client, uid)
            root = world.base_state("rover")
            assert math.hypot(*root.linear) > 0.5
            joints = {index: world.client.getJointState(uid, index)[:2] for index in range(len(links.axes))}
            frames = dict(zip([link.name for link in links.rest], links.states(root, joints), strict=True))
            for wrench in wrenches:
                link = wrench.body.removeprefix("rover/")
                if link.endswith("wheel"):
                    assert wrench.centre == pytest.approx(frames[link].position, abs=1e-9), link
        assert world.state("rover") == unread.state("rover") and world.joints("rover") == unread.joints("rover")
