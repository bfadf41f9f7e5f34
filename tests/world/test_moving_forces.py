"""The ground's force on what lies on it is m (g + a) while it heaves and maps come less often than steps, and an IMU
measures g + a."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, Imu, ImuConfig, MotionConfig, World
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.grounds import level

MASS, RATE, AMPLITUDE, CIRCLING = 3.0, 240, 0.1, 2.0 * math.pi
SIDE = 41
INTERPOLATE, SMOOTH = MotionConfig(mode="interpolate"), MotionConfig(smoothing=2.0)

Update = Callable[[World, float, float], None]


def replace(world: World, height: float, time: float) -> None:
    world.terrain.tiles[""].replace(np.full((SIDE, SIDE), height), time=time)  # type: ignore[union-attr]


def in_regions(world: World, height: float, time: float) -> None:
    """In two halves, of which each is in blocks of its own and in some of the other's."""
    for row in (0, SIDE // 2):
        part = np.full((SIDE - SIDE // 2 if row else SIDE // 2, SIDE), height)
        world.terrain.tiles[""].update_region(row, 0, part, time=time)  # type: ignore[union-attr]


def scrolled(world: World, height: float, time: float) -> None:
    """A window that travels by a cell with each map."""
    by = 0.1 * (round(time * RATE) % 7 - 3)
    heights = np.full((SIDE, SIDE), height)
    motion = world.terrain.tiles[""].motion
    world.terrain.put("", HeightMap(heights, resolution=0.1, origin=(-2.0 + by, -2.0), time=time, motion=motion))


def as_mesh(world: World, height: float, time: float) -> None:
    world.terrain.tiles[""].move(vertices(height), time=time)  # type: ignore[union-attr]


UPDATES = (replace, in_regions, scrolled, as_mesh)


def vertices(height: float) -> np.ndarray:
    row, column = np.divmod(np.arange(SIDE * SIDE), SIDE)
    return np.stack([0.1 * column - 2.0, 0.1 * row - 2.0, np.full(SIDE * SIDE, height)], axis=1)


@pytest.mark.parametrize(
    ("update", "motion", "maps", "share", "off"),
    [
        *((update, INTERPOLATE, 20, 1.0, 0.06) for update in UPDATES), (replace, INTERPOLATE, 60, 1.0, 0.01),
        *((update, SMOOTH, 60, 0.95, 0.1) for update in UPDATES),
    ],
)  # fmt: skip
def test_forces_on_heaving_ground_are_right_and_measured(
    update: Update, motion: MotionConfig, maps: int, share: float, off: float
) -> None:
    """In a share of the steps off by no more than a share of the weight, on ground that is shown a map late if it is
    interpolated."""
    ground = TriangleMesh(vertices(0.0), grid_triangles(SIDE, SIDE), motion=motion)
    with World(ground if update is as_mesh else level(SIDE, motion=motion)) as world:
        world.spawn("box", Box(0.4, 0.4, 0.2), MASS, BodyState((0.0, 0.0, 0.1)))
        imu, forces = Imu(world, "box", config=ImuConfig(rate=RATE)), []
        for step in range(4 * RATE):
            if step % (RATE // maps) == 0:
                update(world, AMPLITUDE * math.sin(CIRCLING * world.time), world.time)
            world.step()
            forces.append(world.wrenches()[0].force)
        measured = np.array([one.acceleration for one in imu.take()])
    np.testing.assert_allclose(measured, np.array(forces) / MASS, atol=1e-3)
    times = np.arange(1.0, 4.0, 1.0 / RATE) + 0.5 / RATE - (1.0 / maps if motion is INTERPOLATE else 0.0)
    right = 9.81 - AMPLITUDE * CIRCLING**2 * np.sin(CIRCLING * times)
    assert np.quantile(np.abs(measured[RATE:, 2] - right), share) <= off * 9.81
