"""How whole maps become the terrain, as the node takes them."""

import math

import numpy as np
import pytest

from smartmesh_ros import HeightMap, World
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.inputs.maps import take_map
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.terrain import Terrain
from tests.belts import Belt, ride, steady


def take(world: World, geometry: GridGeometry, heights: np.ndarray, time: float) -> None:
    take_map(world.terrain, Settings(), "", Raster(geometry, heights), None, time)


@pytest.mark.parametrize(
    "belt",
    [
        Belt(steady(1.0), resolution=0.5, maps=240),
        Belt(steady(0.05)),
        Belt(steady(0.03, -0.018), maps=20),
        Belt(steady(0.5), maps=20),
    ],
    ids=["coarse", "slow", "along x and y", "20 Hz"],
)
def test_a_belt_of_any_speed_takes_a_box_along(belt: Belt) -> None:
    x, y, _ = ride(belt, 4.0, put=take).at(4.0).position
    gone = math.hypot(x - 0.013, y - 0.017)
    assert 0.7 <= gone / math.hypot(*belt.place(4.0)[:2]) <= 1.1


def test_a_belt_that_stops_and_whose_map_then_comes_in_place_has_the_box_at_rest() -> None:
    found = ride(Belt(lambda time: (0.3 * min(time, 0.99), 0.0, 0.0)), 2.0, put=take)
    assert found.at(0.98).linear[0] == pytest.approx(0.3, abs=0.02)
    assert abs(found.at(1.3).linear[0]) < 1e-3
    assert found.at(2.0).position[0] == pytest.approx(found.at(1.3).position[0], abs=1e-3)


def test_a_turntable_takes_a_box_round() -> None:
    found = ride(Belt(lambda time: (0.0, 0.0, 0.5 * time)), 4.0, start=(1.0, 0.0), put=take).at(4.0)
    assert math.atan2(found.position[1], found.position[0]) == pytest.approx(2.0, abs=0.06)


def test_a_map_that_travels_with_a_robot_takes_nothing_along() -> None:
    belt = Belt(lambda time: (0.1 * round(60.0 * time), 0.0, 0.0), maps=20, noise=0.004)
    assert ride(belt, 0.25, put=take).at(0.25).position[:2] == pytest.approx((0.013, 0.017), abs=1e-4)


@pytest.mark.parametrize("speed", [0.0, 0.02, 3.0])
def test_ground_that_rises_while_its_map_slides_is_known_to_rise(speed: float) -> None:
    """Sample by sample, which slide with it."""
    belt, terrain = Belt(steady(speed)), Terrain()
    slopes = np.linspace(-1.0, 1.0, 41, dtype=np.float32) * np.ones((41, 1), np.float32)
    for step in range(4):
        time = step / 60
        take_map(terrain, Settings(), "", Raster(belt.geometry(time), slopes * np.float32(0.5 * time)), None, time)
    heightmap = terrain.tiles[""]
    assert isinstance(heightmap, HeightMap)
    found = heightmap.sample(np.arange(41 * 41), 3 / 60).velocities
    np.testing.assert_allclose(found, 0.5 * slopes.ravel(), atol=1e-4)


def test_a_map_that_is_raised_as_a_whole_is_known_to_rise() -> None:
    """Its origin's z moves, and its heights do not."""
    terrain, flat = Terrain(), np.zeros((9, 9), np.float32)
    for step in range(3):
        geometry = GridGeometry(rows=9, columns=9, resolution=0.1, origin=(0.0, 0.0, 0.5 * step / 60))
        take_map(terrain, Settings(), "", Raster(geometry, flat), None, step / 60)
    assert terrain.at([[0.4, 0.4]], 2 / 60).velocities[0] == pytest.approx(0.5, abs=1e-3)
