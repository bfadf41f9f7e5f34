"""An IMU measures what the closed forms say: in free fall, of whatever moves, and on ground that heaves, whose force on
what lies on it is m (g + a)."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Imu, ImuConfig, ImuReading, MotionConfig, Terrain, World
from tests import urdfs
from tests.bodies import rotation
from tests.grounds import level, moving, world_of

GRAVITY = 9.81
UP = (0.0, 0.0, GRAVITY)


def taken(imu: Imu) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The times (n,), accelerations (n, 3) and angular velocities (n, 3) of the readings so far."""
    found = imu.take()
    return tuple(np.array([getattr(one, name) for one in found])  # type: ignore[return-value]
                 for name in ("time", "acceleration", "angular_velocity"))  # fmt: skip


def test_in_free_fall_it_measures_nothing_and_off_the_centre_the_spin() -> None:
    """A link at a distance from the centre of mass of a robot that spins feels -w^2 r along its lever. Its axes are its
    own: the y axis is upright."""
    rod = urdfs.robot(
        urdfs.link("base", urdfs.box((0.2, 0.2, 0.2)), 10.0, 1.0, at="0.1 0 0"),
        urdfs.link("imu", "", 1e-6, 1e-9, at="0.1 0.2 0"),  # its centre of mass is elsewhere
        urdfs.joint("mount", "fixed", "base", "imu", xyz="0.4 0 0", rpy=f"{0.5 * math.pi} 0 0"),
    )  # fmt: skip
    with World() as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 50.0), linear=(1, 0, 3), angular=(0, 0, 3)))
        world.spawn_robot("rod", rod, BodyState((5.0, 0.0, 50.0), angular=(0.0, 0.0, 5.0)))
        centre, base, tip = Imu(world, "box"), Imu(world, "rod"), Imu(world, "rod", "imu")
        world.step(240)
        for imu, force, spin in (
            (centre, 0.0, (0, 0, 3)), (base, 5.0**2 * 0.1, (0, 0, 5)), (tip, -(5.0**2) * 0.3, (0, 5, 0)),
        ):  # fmt: skip
            _, forces, rates = taken(imu)
            np.testing.assert_allclose(forces, np.tile([force, 0.0, 0.0], (len(forces), 1)), atol=1e-3)
            np.testing.assert_allclose(rates, np.tile(spin, (len(rates), 1)), atol=1e-3)


def test_readings_add_up_to_the_motion_impacts_included() -> None:
    """Strapdown integration of all readings gives the change of the velocity and of the orientation."""
    with World(level(101, friction=1.0)) as world:
        world.spawn("box", Box(0.5, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 1.0), angular=(2.0, 1.0, 3.0)))
        imu, before = Imu(world, "box", config=ImuConfig(rate=240.0)), world.state("box")
        world.step(240)
        velocity, found = np.array(before.linear), imu.take()
        orientations = [before.orientation, *(one.orientation for one in found)]
        for one, start, end in zip(found, orientations[:-1], orientations[1:], strict=True):
            rate = one.angular_velocity
            turn = pb.getQuaternionFromAxisAngle(rate, one.duration * float(np.linalg.norm(rate)))
            np.testing.assert_allclose(rotation(start) @ rotation(turn), rotation(end), atol=1e-6)
            halfway = np.add(start, np.copysign(1.0, np.dot(start, end)) * np.array(end))
            velocity += (rotation(halfway / np.linalg.norm(halfway)) @ one.acceleration - UP) * one.duration
        np.testing.assert_allclose(velocity, world.state("box").linear, atol=1e-5)


MASS, RATE, AMPLITUDE, CIRCLING = 3.0, 240, 0.1, 2.0 * math.pi
INTERPOLATE, SMOOTH = MotionConfig(mode="interpolate"), MotionConfig(smoothing=2.0)


@pytest.mark.parametrize(
    ("motion", "maps", "share", "off"),
    [(INTERPOLATE, 20, 1.0, 0.06), (INTERPOLATE, 60, 1.0, 0.01), (SMOOTH, 60, 0.95, 0.1)],
)
def test_on_heaving_ground_its_forces_are_right(motion: MotionConfig, maps: int, share: float, off: float) -> None:
    """In a share of the steps off by no more than a share of the weight, on ground that is shown a map late if it is
    interpolated."""
    with World(level(motion=motion)) as world:
        world.spawn("box", Box(0.4, 0.4, 0.2), MASS, BodyState((0.0, 0.0, 0.1)))
        imu = Imu(world, "box", config=ImuConfig(rate=RATE))
        steps = moving(world, lambda time: AMPLITUDE * math.sin(CIRCLING * time), 4 * RATE, RATE // maps)
        forces = [world.wrenches()[0].force for _ in steps]
        measured = np.array([one.acceleration for one in imu.take()])
    np.testing.assert_allclose(measured, np.array(forces) / MASS, atol=1e-3)
    times = np.arange(1.0, 4.0, 1.0 / RATE) + 0.5 / RATE - (1.0 / maps if motion is INTERPOLATE else 0.0)
    right = 9.81 - AMPLITUDE * CIRCLING**2 * np.sin(CIRCLING * times)
    assert np.quantile(np.abs(measured[RATE:, 2] - right), share) <= off * 9.81


def noisy(config: ImuConfig, steps: int) -> list[ImuReading]:
    with world_of(Terrain(), gravity=(0.0, 0.0, 0.0)) as world:
        world.spawn("box", Box(0.4, 0.4, 0.2), 1.0)
        imu = Imu(world, "box", config=config)
        world.step(steps)
        return imu.take()


def test_noise_bias_and_random_walk_are_those_of_the_settings() -> None:
    """White noise of density n has the variance n^2 x rate; a random walk of density k that of k^2 x time."""
    config = ImuConfig(
        rate=120.0, accelerometer_noise_density=0.02, gyroscope_noise_density=0.001,
        accelerometer_bias=(0.1, 0.2, 0.3), gyroscope_bias=(-0.01, 0.0, 0.01),
    )  # fmt: skip
    found = noisy(config, 4800)
    forces, rates = (np.array([getattr(one, name) for one in found]) for name in ("acceleration", "angular_velocity"))
    assert len(found) == 2400
    for values, density, bias in (
        (forces, 0.02, config.accelerometer_bias), (rates, 0.001, config.gyroscope_bias)
    ):  # fmt: skip
        deviation = density * math.sqrt(120.0)
        np.testing.assert_allclose(values.mean(axis=0), bias, atol=5.0 * deviation / math.sqrt(2400))
        np.testing.assert_allclose(values.std(axis=0), deviation, rtol=0.05)
    walks = noisy(ImuConfig(rate=120.0, accelerometer_random_walk=0.05), 4800)
    steps = np.diff([one.acceleration for one in walks], axis=0)
    np.testing.assert_allclose(steps.std(axis=0), 0.05 / math.sqrt(120.0), rtol=0.05)
    np.testing.assert_allclose([one.angular_velocity for one in walks], 0.0, atol=1e-12)
    again, other = (noisy(replace(config, seed=seed), 60)[0].acceleration for seed in (config.seed, config.seed + 1))
    assert np.array_equal(again, found[0].acceleration), "the same in each run"
    assert not np.array_equal(again, other), "another by another seed"


def test_measuring_changes_nothing_and_ends_with_close() -> None:
    states = []
    for measured in (False, True):
        with World(level(101, friction=1.0)) as world:
            world.spawn_robot("husky", urdfs.HUSKY, BodyState((0.0, 0.0, 0.3)))
            imus = [Imu(world, "husky", link) for link in ("", "imu_link", "front_left_wheel_link")] if measured else []
            world.drive("husky", "front_left_wheel", 4.0)
            world.step(120)
            states.append(world.snapshot().hash)
            for imu in imus:
                assert imu.take()
                imu.close()
            world.step(12)
            assert not any(imu.take() for imu in imus)
    assert states[0] == states[1]


def test_a_teleport_is_no_acceleration_and_what_is_not_there_is_not_measured() -> None:
    with World() as world:
        imus = [Imu(world, "box"), Imu(world, "box", "lid"), Imu(world, "tracked")]
        world.track("tracked", 0.2, BodyState())
        world.step(24)
        assert not any(imu.take() for imu in imus)
        world.spawn("box", Box(0.4, 0.4, 0.2), 1.0, BodyState((0.0, 0.0, 3.0)))
        for place in (5.0, 9.0):
            world.step(12)
            world.move("box", BodyState((place, 0.0, 3.0), linear=(place, 2.0, 0.0)))
        world.reset()
        world.step(24)
        _, forces, _ = taken(imus[0])
        np.testing.assert_allclose(forces, 0.0, atol=1e-9)
        assert len(forces) == pytest.approx(20, abs=2)
        assert not imus[1].take()
        assert not imus[2].take()


def test_biases_that_are_lists_or_arrays_are_compared_as_tuples() -> None:
    bias: Any = [0.1, 0.0, 0.0]
    configs = [ImuConfig(gyroscope_bias=given) for given in (bias, np.array(bias), tuple(bias))]
    assert len({*configs}) == 1
