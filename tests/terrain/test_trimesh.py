"""General meshes: what they refuse, and how they move."""

from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles


def grid(rows: int = 6, columns: int = 8) -> np.ndarray:
    r, c = np.divmod(np.arange(rows * columns), columns)
    return np.stack([c, r, np.sin(0.7 * c + 0.3 * r)], axis=1)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: TriangleMesh(grid()[:, :2], grid_triangles(6, 8)), "length"),
        (lambda: TriangleMesh(grid(), [[0, 1]]), "length"),
        (lambda: TriangleMesh(grid(), np.zeros((0, 3), int)), "length"),
        (lambda: TriangleMesh(grid(), [[0, 1, 48]]), "index"),
        (lambda: TriangleMesh(grid(), [[0, 1, -1]]), "index"),
        (lambda: TriangleMesh(grid(), [[0, 1, 1]]), "index"),
        (lambda: TriangleMesh(grid(), [[0.0, 1.0, 2.0]]), "type"),
        (lambda: TriangleMesh(grid() * np.nan, grid_triangles(6, 8)), "non_finite"),
        (lambda: TriangleMesh(grid(), grid_triangles(6, 8), velocities=np.zeros((3, 3))), "length"),
    ],
)
def test_impossible_meshes_are_refused(make: Callable[[], TriangleMesh], reason: str) -> None:
    with pytest.raises(InputError) as error:
        make()
    assert error.value.reason == reason


@pytest.mark.parametrize(
    ("move", "reason"),
    [
        (lambda m: m.move(np.zeros((3, 3)), time=1.0), "length"),
        (lambda m: m.move(np.zeros((1, 3)), time=1.0, indices=[48]), "index"),
        (lambda m: m.move(np.zeros((2, 3)), time=1.0, indices=[4, 4]), "index"),
        (lambda m: m.move(np.zeros((2, 3)), time=1.0, indices=[4]), "length"),
        (lambda m: m.move(np.full((1, 3), np.inf), time=1.0, indices=[4]), "non_finite"),
    ],
)
def test_impossible_moves_are_refused_and_change_nothing(move: Callable[[TriangleMesh], None], reason: str) -> None:
    mesh = TriangleMesh(grid(), grid_triangles(6, 8))
    with pytest.raises(InputError) as error:
        move(mesh)
    assert error.value.reason == reason
    np.testing.assert_array_equal(mesh.vertices, grid())
    assert mesh.time == 0.0


def test_vertices_move_with_the_velocity_of_their_positions() -> None:
    mesh = TriangleMesh(grid(), grid_triangles(6, 8))
    mesh.move(grid() + (0.1, 0.0, 0.2), time=0.1)
    samples = mesh.sample(np.array([3, 20]), 0.15)
    np.testing.assert_allclose(samples.velocities, [[1.0, 0.0, 2.0]] * 2, atol=1e-9)
    np.testing.assert_allclose(samples.positions, grid()[[3, 20]] + (0.15, 0.0, 0.3), atol=1e-9)
    mesh.move(grid()[[3]], time=0.2, indices=[3])
    samples = mesh.sample(np.array([3, 20]), 0.2)
    np.testing.assert_allclose(samples.velocities, [[-1.0, 0.0, -2.0], [0.0, 0.0, 0.0]], atol=1e-9)


def test_vertices_moved_in_parts_at_one_instant_all_move() -> None:
    mesh = TriangleMesh(grid(), grid_triangles(6, 8))
    for vertex in (3, 20):
        mesh.move(grid()[[vertex]], time=0.1, indices=[vertex], velocities=[[0.0, 0.0, 2.0]])
    samples = mesh.sample(np.array([3, 20, 21]), 0.15)
    np.testing.assert_allclose(samples.velocities, [[0.0, 0.0, 2.0]] * 2 + [[0.0, 0.0, 0.0]], atol=1e-9)
    mesh = TriangleMesh(grid(), grid_triangles(6, 8))
    for vertex in (3, 20):
        mesh.move(grid()[[vertex]] + (0.0, 0.0, 0.2), time=0.1, indices=[vertex])
    samples = mesh.sample(np.array([3, 20, 21]), 0.15)
    np.testing.assert_allclose(samples.velocities, [[0.0, 0.0, 2.0]] * 2 + [[0.0, 0.0, 0.0]], atol=1e-9)


def test_a_mesh_of_a_grid_samples_as_the_height_map_does() -> None:
    heights = np.random.default_rng(0).normal(size=(6, 8))
    vertices = grid()
    vertices[:, 2] = heights.ravel()
    mesh, heightmap = TriangleMesh(vertices, grid_triangles(6, 8)), HeightMap(heights, resolution=1.0)
    points = np.random.default_rng(1).uniform((-0.5, -0.5), (7.5, 5.5), (200, 2))
    np.testing.assert_allclose(mesh.at(points, 0.0).heights, heightmap.at(points, 0.0).heights, atol=1e-6)
