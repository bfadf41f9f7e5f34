"""The ground's force on what lies on it is m (g + a) while it heaves and maps come less often than steps, and an IMU
measures g + a. Maps in regions, maps that travel, and meshes move as whole maps do: tests/terrain."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Imu, ImuConfig, MotionConfig, World
from tests.grounds import level, moving

MASS, RATE, AMPLITUDE, CIRCLING = 3.0, 240, 0.1, 2.0 * math.pi
INTERPOLATE, SMOOTH = MotionConfig(mode="interpolate"), MotionConfig(smoothing=2.0)


@pytest.mark.parametrize(
    ("motion", "maps", "share", "off"),
    [(INTERPOLATE, 20, 1.0, 0.06), (INTERPOLATE, 60, 1.0, 0.01), (SMOOTH, 60, 0.95, 0.1)],
)
def test_forces_on_heaving_ground_are_right_and_measured(
    motion: MotionConfig, maps: int, share: float, off: float
) -> None:
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
