"""The ground's force on what lies on it, while it heaves and maps come less often than steps: m (g + a)."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, MotionConfig, World
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles

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


def vertices(height: float) -> np.ndarray:
    row, column = np.divmod(np.arange(SIDE * SIDE), SIDE)
    return np.stack([0.1 * column - 2.0, 0.1 * row - 2.0, np.full(SIDE * SIDE, height)], axis=1)


def share_off(update: Update, motion: MotionConfig, maps: int, delay: float) -> float:
    """Share of the steps of three heaves in which the force is off by more than a tenth of the weight [%], with so many
    maps a second, and ground that is shown so late [s]."""
    if update is as_mesh:
        world = World(TriangleMesh(vertices(0.0), grid_triangles(SIDE, SIDE), motion=motion))
    else:
        world = World(HeightMap(np.zeros((SIDE, SIDE)), resolution=0.1, origin=(-2.0, -2.0), motion=motion))
    world.spawn("box", Box(0.4, 0.4, 0.2), MASS, BodyState((0.0, 0.0, 0.1)))
    off = []
    for step in range(4 * RATE):
        time = step / RATE
        if step % (RATE // maps) == 0:
            update(world, AMPLITUDE * math.sin(CIRCLING * time), time)
        world.step()
        right = 9.81 - AMPLITUDE * CIRCLING**2 * math.sin(CIRCLING * (time + 0.5 / RATE - delay))
        off.append(abs(world.wrenches()[0].force[2] / MASS - right) > 0.1 * 9.81)
    world.close()
    return 100.0 * float(np.mean(off[RATE:]))


@pytest.mark.parametrize(
    ("update", "motion", "maps", "most"),
    [
        (replace, INTERPOLATE, 60, 5.0), (replace, INTERPOLATE, 20, 15.0), (in_regions, INTERPOLATE, 20, 15.0),
        (scrolled, INTERPOLATE, 20, 15.0), (as_mesh, INTERPOLATE, 20, 15.0), (replace, SMOOTH, 60, 5.0),
        (in_regions, SMOOTH, 60, 5.0), (scrolled, SMOOTH, 60, 5.0), (as_mesh, SMOOTH, 60, 5.0),
    ],
)  # fmt: skip
def test_forces_on_heaving_ground_are_right(update: Update, motion: MotionConfig, maps: int, most: float) -> None:
    """To a tenth of the weight in most steps: at 60 maps a second in 95 %, at 20 in 85 %."""
    assert share_off(update, motion, maps, 1.0 / maps if motion is INTERPOLATE else 0.0) <= most
