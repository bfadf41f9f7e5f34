"""Bases drive as told: straight at the commanded speed, in turns at the commanded rate, until their time is over."""

import copy
import math
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest

from smartmesh_ros import (
    Base,
    BaseConfig,
    BodyState,
    HeightScan,
    HeightScanner,
    Imu,
    ImuConfig,
    InputError,
    World,
)
from tests import urdfs
from tests.bodies import about_z, rate_of_turn, rotation, yaw_of
from tests.grounds import level, said_by, shaped, world_of
from tests.tracked import UNDERCARRIAGE

RACECAR = str(Path(pybullet_data.getDataPath()) / "racecar" / "racecar.urdf")
HUSKY_WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
REAR = ("left_rear_wheel_joint", "right_rear_wheel_joint")
FRONT = ("left_front_wheel_joint", "right_front_wheel_joint")
HINGES = ("left_steering_hinge_joint", "right_steering_hinge_joint")
RADIUS, GAUGE = 0.15, 0.5  # of the wheels of a cart, and the distance of its wheels [m]


def wheel(name: str, x: float, y: float, axis: str = "0 1 0") -> str:
    shape = f'<cylinder radius="{RADIUS}" length="0.04"/>'
    return urdfs.link(f"{name}_link", shape, 1.0, 0.01, rpy="1.5707963267948966 0 0") + urdfs.joint(
        name, "continuous", "base", f"{name}_link", '<limit effort="20" velocity="12"/>', f"{x} {y} 0", axis
    )


# Two driven wheels, the right one with its axis reversed, and a caster that slides before them.
CART = urdfs.robot(
    urdfs.link("base", "", 10.0, 0.5, at="0.05 0 0"), wheel("left", 0.0, 0.5 * GAUGE),
    wheel("right", 0.0, -0.5 * GAUGE, "0 -1 0"),
    urdfs.link("ball", f'<sphere radius="{RADIUS}"/>', 0.5, 0.01,
               '<contact><lateral_friction value="0"/></contact>'),
    urdfs.joint("caster", "fixed", "base", "ball", xyz="0.3 0 0"),
)  # fmt: skip
ROBOTS = {
    "cart": (CART, BaseConfig(wheels=("left", "right"))),
    "axle behind": (CART.replace('xyz="0.0 ', 'xyz="-0.3 '), BaseConfig(wheels=("left", "right"))),
    "husky": (urdfs.HUSKY, BaseConfig(wheels=HUSKY_WHEELS)),
    "racecar": (RACECAR, BaseConfig(wheels=REAR, steering=HINGES)),
    "racecar, all driven": (RACECAR, BaseConfig(wheels=REAR + FRONT, steering=HINGES)),
    "racecar, front driven": (RACECAR, BaseConfig(wheels=FRONT, steering=HINGES, wheelbase=0.325)),
    "tracks": (UNDERCARRIAGE, BaseConfig(tracks=("left_track", "right_track"))),
}


@contextmanager
def standing(name: str, **changes: object) -> Iterator[tuple[World, Base]]:
    """A robot that stands on level ground, and its base, with other settings."""
    urdf, config = ROBOTS[name]
    with world_of(level(201), friction=1.0) as world:
        world.spawn_robot("robot", urdf, BodyState(), on_ground=True)
        base = Base(world, "robot", BaseConfig(**{**vars(config), **changes}))  # type: ignore[arg-type]
        world.step(240)
        yield world, base


def pose(world: World) -> np.ndarray:
    state = world.base_state("robot")
    return np.array([*state.position[:2], yaw_of(state.orientation)])


def mean_velocity(world: World, steps: int) -> np.ndarray:
    """Step the world, and return the mean velocity along x and y [m/s]: a tracked machine rocks."""
    start = pose(world)
    world.step(steps)
    return np.asarray((pose(world) - start)[:2] / (steps * world.dt))


def turned(world: World, steps: int) -> float:
    """Step the world, and return the angle by which the robot turns [rad]."""
    yaws = [pose(world)[2]]
    for _ in range(steps // 24):
        world.step(24)
        yaws.append(pose(world)[2])
    yaws = np.unwrap(yaws).tolist()
    return yaws[-1] - yaws[0]


@pytest.mark.parametrize(
    ("name", "linear", "angular", "bound"),
    [
        *((name, speed, 0.0, 0.0) for name in ROBOTS for speed in (0.8, -0.5)),
        ("cart", 0.0, 1.2, 0.01), ("cart", 0.5, -0.8, 0.01), ("cart", -0.4, 0.8, 0.01), ("axle behind", 0.2, 1.0, 0.01),
        ("racecar", 0.8, 1.0, 0.02), ("racecar", -0.5, 0.6, 0.02), ("racecar, all driven", 0.8, -1.0, 0.02),
        ("racecar, front driven", 0.8, 1.0, 0.03), ("tracks", 0.0, 0.8, 0.04), ("tracks", 0.6, -0.4, 0.04),
    ],
)  # fmt: skip
def test_it_moves_as_commanded_and_its_odometry_says_so(name: str, linear: float, angular: float, bound: float) -> None:
    """A robot whose axle is behind its root link moves that sideways in a turn."""
    with standing(name) as (world, base):
        base.drive(linear, angular)
        world.step(240)
        before, then = pose(world), base.odometry
        assert turned(world, 480) == pytest.approx(2.0 * angular, rel=bound, abs=0.005 * abs(linear))
        (x, y, yaw), found = pose(world), base.odometry
        assert found.yaw - then.yaw == pytest.approx(2.0 * angular, rel=0.005, abs=0.001)
        if not angular:
            np.testing.assert_allclose([x, y] - before[:2], [2.0 * linear, 0.0], atol=0.005 * abs(linear))
            assert (found.x - then.x, found.linear) == pytest.approx((2.0 * linear, linear), rel=0.005)
        if linear and angular and name != "axle behind":  # the way of a turn points to the middle of its headings
            way = math.atan2((found.y - then.y) * linear, (found.x - then.x) * linear)
            assert math.remainder(way - 0.5 * (then.yaw + found.yaw), math.tau) == pytest.approx(0.0, abs=5e-4)
        if len(base.config.wheels) == 2 and not base.config.steering:  # without slip
            chord = math.dist((then.x, then.y), (found.x, found.y))
            assert chord == pytest.approx(math.dist(before[:2], (x, y)), abs=0.04)
            speed = world.base_state("robot").linear
            aside = 0.3 * angular if name == "axle behind" else 0.0
            assert found.side == pytest.approx(aside, rel=0.02, abs=0.01)
            assert math.cos(yaw) * speed[1] - math.sin(yaw) * speed[0] == pytest.approx(aside, rel=0.02, abs=0.02)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_wheels_behind_one_another_spin_by_the_law_of_friction_so_that_the_base_turns_on_the_spot(sign: float) -> None:
    """At all headings alike."""
    with standing("husky") as (world, base):
        gauge, wheelbase, radius = 0.57, 0.512, 0.17775
        base.drive(0.0, sign)
        world.step(2)
        spin = np.mean([abs(joint.velocity) for joint in world.joints("robot")]) * radius
        assert spin == pytest.approx(0.5 * gauge * (1.0 + (wheelbase / gauge) ** 2), rel=0.05)
        world.step(240)
        for _ in range(12):
            rate = turned(world, 120) / (120 * world.dt)
            x, y, yaw = pose(world)
            contacts = world.contacts()
            levers = np.array([(*it.position[:2], 0.0) for it in contacts]) - (x, y, 0.0)
            levers = (levers @ rotation(about_z(yaw)))[:, :2]
            loads = np.array([it.normal_force for it in contacts])
            assert rate == pytest.approx(rate_of_turn(levers, -np.sign(levers[:, 1]) * sign * spin, loads), rel=0.02)


@pytest.mark.parametrize("name", ["cart", "racecar", "tracks"])
def test_it_stops_when_its_time_is_over_and_says_so(name: str) -> None:
    with standing(name) as (world, base):
        said = said_by(world)
        base.drive(0.5, 0.0, lasts=1.0)
        world.step(119)
        assert mean_velocity(world, 120) == pytest.approx([0.5, 0.0], abs=0.01)
        assert not said
        world.step(120)
        assert mean_velocity(world, 120) == pytest.approx([0.0, 0.0], abs=0.015)
        assert said == ["no command came for the base 'robot' in time: it stops"]
        for _ in range(4):  # commands that come in time
            base.drive(0.5, 0.0, lasts=0.5)
            moved = mean_velocity(world, 100)
        assert moved == pytest.approx([0.5, 0.0], abs=0.01)


def test_it_keeps_to_its_limits() -> None:
    with standing("cart", linear_limit=0.6, angular_limit=0.5, linear_acceleration=0.5) as (world, base):
        base.drive(3.0, 0.0)
        speeds = []
        for _ in range(12):
            world.step(24)
            speeds.append(world.base_state("robot").linear[0])
        np.testing.assert_allclose(speeds, np.minimum(0.05 * np.arange(1, 13), 0.6), atol=0.02)
        base.drive(0.0, -9.0)
        world.step(480)
        assert turned(world, 240) == pytest.approx(-0.5, rel=0.03)
    with standing("cart") as (world, base):  # wheels that turn by 12 rad/s at most: both slower on the same path
        base.drive(3.0, 4.0)
        world.step(240)
        fastest = 12.0 * RADIUS
        expected = np.array([3.0, 4.0]) * fastest / (3.0 + 4.0 * 0.5 * GAUGE)
        assert (base.odometry.linear, base.odometry.angular) == pytest.approx(tuple(expected), rel=0.02)
    with standing("racecar") as (world, base):  # hinges that turn by 1 rad: as tight a turn as they reach
        base.drive(0.5, 9.0)
        world.step(240)
        inner = 0.325 / math.tan(1.0)  # from the inner wheel to the middle of the turn
        assert turned(world, 480) == pytest.approx(2.0 * 0.5 / (inner + 0.1), rel=0.08)
        base.drive(0.0, 2.0)
        world.step(240)
        assert abs(turned(world, 240)) < 0.01, "a car that stands does not turn"


def test_it_holds_its_wheels_comes_back_with_its_robot_and_starts_anew_with_the_time() -> None:
    with world_of(shaped(lambda x, y: 0.1 * x, 201), friction=1.0) as world:
        base = Base(world, "robot", BaseConfig(wheels=("left", "right")))
        world.step(2)
        with pytest.raises(InputError, match="no robot 'robot'"):
            base.drive(1.0, 0.0)
        for _ in range(2):
            world.spawn_robot("robot", CART, BodyState(), on_ground=True, align=True)
            world.step(240)
            assert math.hypot(*world.base_state("robot").linear) < 0.01, "it holds on a slope"
            base.drive(0.5, 0.0)
            world.step(240)
            assert base.odometry.linear == pytest.approx(0.5, rel=0.02)
            world.remove("robot")
            world.step()
        world.spawn_robot("robot", CART, BodyState(), on_ground=True, align=True)
        world.step(24)
        world.reset()
        world.step()
        assert abs(base.odometry.x) < 1e-3
        base.close()
        assert not world.watchers


def test_episodes_begin_without_commands_and_a_reset_leaves_them_their_time() -> None:
    with standing("cart", linear_acceleration=0.5) as (world, base):
        said = said_by(world)
        states = []
        for _ in range(3):
            world.reset(seed=0)
            world.step(240)
            states.append((world.state("robot"), base.odometry))
            base.drive(1.0, 0.0, lasts=2.0)
            world.step(60)  # it is still becoming faster
        assert states[0] == states[1] == states[2]
        assert not said
        world.reset()
        world.step(240)
        base.drive(0.5, 0.0, lasts=2.0)
        world.step(240)
        assert world.base_state("robot").linear[0] == pytest.approx(0.5, abs=0.03)
        said.clear()
        world.reset()
        world.step(360)
        assert said == ["no command came for the base 'robot' in time: it stops"]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_a_copy_goes_on_in_the_copy_of_its_world(copied: Callable[[Any], Any]) -> None:
    """With the sensors of the robot: a copy of an environment is one that goes on as it does."""
    with standing("axle behind", linear_acceleration=0.5) as (world, base):
        scan = HeightScan.of("isaac_lab", noise=0.02, delay=0.02)
        imu = Imu(world, "robot", config=ImuConfig(rate=50.0, accelerometer_noise_density=0.01))
        made = base, imu, HeightScanner(world, "robot", scan), world
        seen = []
        base.drive(0.6, 0.4, lasts=0.5)
        for _ in range(7):
            world.step(11)
            made[2].read()
        world.save()
        for driver, sensor, scanner, its in (copied(made), made):
            assert (driver.odometry, its.watchers) == (base.odometry, [driver, sensor])
            scans = []
            for _ in range(20):
                its.step(10)
                scans.append(scanner.read().tobytes())
            seen.append((its.snapshot().hash, driver.odometry, repr(sensor.take()), scans))
            driver.close()
            assert copied((its, driver))[0].watchers == []
        assert seen[0] == seen[1]
        assert seen[0][1].x > 0.1


@pytest.mark.parametrize(
    ("name", "config", "words"),
    [
        ("cart", BaseConfig(wheels=("left", "middle")), "no joint 'middle'; it has left, right"),
        ("cart", BaseConfig(wheels=("left",)), "all on one side"),
        ("cart", BaseConfig(tracks=("left_track",)), "no track 'left_track'; it has none"),
        ("racecar", BaseConfig(wheels=HINGES), "not along y"),
        ("racecar", BaseConfig(wheels=FRONT, steering=REAR), "not along z"),
        ("racecar", BaseConfig(wheels=FRONT, steering=HINGES), "give the wheelbase"),
    ],
)
def test_what_does_not_fit_the_robot_is_said_once_and_refused(name: str, config: BaseConfig, words: str) -> None:
    with World() as world:
        said = said_by(world)
        world.spawn_robot("robot", ROBOTS[name][0])
        base = Base(world, "robot", config)
        said.clear()
        world.step(3)
        assert len(said) == 1
        assert words in said[0]
        with pytest.raises(InputError, match=words):
            base.drive(1.0, 0.0)


@pytest.mark.parametrize(
    ("speed", "lasts", "words"), [(math.nan, 1.0, "not finite"), ("fast", 1.0, "not finite"), (1.0, math.nan, "durat")]
)
def test_a_command_that_cannot_be_is_refused(speed: Any, lasts: float, words: str) -> None:
    with World() as world, pytest.raises(InputError, match=words):
        Base(world, "robot", BaseConfig(wheels=("left", "right"))).drive(speed, 0.0, lasts)


def test_a_robot_has_one_base_until_that_is_closed() -> None:
    with standing("cart") as (world, first):
        other = BaseConfig(wheels=("left", "right"), linear_limit=0.2)
        with pytest.raises(InputError, match=r"drives 'robot' already.*close"):
            Base(world, "robot", other)
        world.restore(world.save())
        world.remove("robot")
        world.spawn_robot("robot", ROBOTS["cart"][0], BodyState(), on_ground=True)
        first.drive(0.5, 0.0)
        assert mean_velocity(world, 480)[0] == pytest.approx(0.5, rel=0.1)
        first.close()
        second = Base(world, "robot", other)
        second.drive(0.5, 0.0)
        world.step(240)
        assert mean_velocity(world, 240)[0] == pytest.approx(0.2, rel=0.02)
