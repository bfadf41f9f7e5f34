"""Prints in a map: they stay while its sender sends the same ground, and go where it sends another."""

import numpy as np

from smartmesh_ros import HeightMap


def test_prints_go_where_others_change_the_ground_and_only_there() -> None:
    flat = np.zeros((8, 8))
    terrain = HeightMap(flat, resolution=0.1)
    places = np.array([[2, 2], [2, 3], [5, 5]])
    terrain.press(places, np.array([-0.01, -0.02, -0.03], np.float32))
    terrain.replace(flat, time=0.1)
    assert np.allclose(terrain.heights[tuple(places.T)], [-0.01, -0.02, -0.03])
    assert np.count_nonzero(terrain.heights) == 3
    terrain.update_region(2, 2, np.array([[0.0, 0.5]]), time=0.2)
    assert np.allclose(terrain.heights[tuple(places.T)], [-0.01, 0.5, -0.03])
    terrain.replace(flat + 1.0, time=0.3)
    assert (terrain.heights == 1.0).all()
    terrain.replace(flat, time=0.4)
    assert (terrain.heights == 0.0).all(), "prints that went do not come back"


def test_prints_are_no_motion_of_the_ground() -> None:
    terrain = HeightMap(np.zeros((8, 8)), resolution=0.1)
    for k in range(1, 6):
        terrain.press(np.array([[4, 4]]), np.array([-0.01 * k], np.float32))
        terrain.replace(np.zeros((8, 8)), time=0.1 * k)
    assert terrain.at([[0.4, 0.4]], 0.55).velocities[0] == 0.0
    terrain.replace(np.full((8, 8), 0.1), time=0.6)
    assert np.isclose(terrain.at([[0.4, 0.4]], 0.6).velocities[0], 1.0), "the ground rose by 0.1 m in 0.1 s"
