"""Every search but the ray, which is only timed, finds what brute force finds, and collects the same vertices, in
patterns of the report's figures."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.tri import Triangulation

from smartmesh_ros import GridGeometry
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from studies.report import search


def stretched(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """A grid of uneven rows and columns, with rough heights."""
    x, y = np.cumsum(rng.uniform(0.1, 2.0, columns)), np.cumsum(rng.uniform(0.1, 2.0, rows))
    r, c = np.divmod(np.arange(rows * columns), columns)
    return np.stack([x[c], y[r], rng.normal(size=rows * columns)], axis=1)


def around(rng: np.random.Generator, vertices: np.ndarray, count: int = 60) -> np.ndarray:
    """Positions inside, on the rim and outside, and some straight over vertices and between them."""
    low, high = vertices.min(axis=0) - 2.0, vertices.max(axis=0) + 2.0
    free = rng.uniform(low, high, (count, 3))
    over = vertices[rng.integers(len(vertices), size=count)]
    between = 0.5 * (vertices[:-1] + vertices[1:])[rng.integers(len(vertices) - 1, size=count)]
    return np.concatenate([free, over, between])


def stretched_mesh(rng: np.random.Generator) -> TriangleMesh:
    rows, columns = rng.integers(3, 15, 2).tolist()
    return TriangleMesh(stretched(rng, rows, columns), grid_triangles(rows, columns))


def delaunay_mesh(rng: np.random.Generator) -> TriangleMesh:
    """Any triangle pattern: random points in a square, triangulated by Matplotlib's Delaunay."""
    inner = rng.uniform(0.5, 9.5, (int(rng.integers(4, 61)), 2))
    xy = np.concatenate([[[0, 0], [0, 10], [10, 0], [10, 10]], inner])
    triangles = np.array(Triangulation(xy[:, 0], xy[:, 1]).triangles)
    return TriangleMesh(np.column_stack([xy, rng.normal(size=len(xy))]), triangles)


@pytest.mark.parametrize("make", [stretched_mesh, delaunay_mesh])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_best_first_is_brute_force_from_above(make: Callable[[np.random.Generator], TriangleMesh], seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = make(rng)
    graph = search.TriangleGraph(mesh.triangles, mesh.size)
    positions = around(rng, mesh.vertices)
    expected = ((mesh.vertices[:, :2] - positions[:, None, :2]) ** 2).sum(axis=2).argmin(axis=1)
    starts = rng.integers(mesh.size, size=len(positions))
    found = [search.best_first_vertex(mesh, graph, p, int(s)) for p, s in zip(positions, starts, strict=True)]
    np.testing.assert_array_equal(found, expected)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 30), st.integers(3, 30), st.floats(-3.0, 3.0))
def test_every_search_agrees_on_height_maps(seed: int, rows: int, columns: int, yaw: float) -> None:
    geometry = GridGeometry(rows=rows, columns=columns, resolution=0.25, origin=(1.0, 2.0, 0.0), yaw=yaw)
    rng = np.random.default_rng(seed)
    grid = rng.uniform((-3, -3), (rows + 3, columns + 3), (50, 2))
    grid[:10] = np.rint(grid[:10]) + 0.5  # as far from four vertices alike: the first of them is the nearest
    expected = search.brute_force_cells(geometry, grid)
    inner = np.stack(np.meshgrid(np.arange(1, rows - 1), np.arange(1, columns - 1), indexing="ij"), axis=-1)
    least = np.linalg.norm(grid[:, None] - inner.reshape(-1, 2), axis=2).min(axis=1)
    np.testing.assert_allclose(np.linalg.norm(grid - expected, axis=1), least, rtol=1e-9, atol=1e-9)
    traversal = search.nearest_vertices(geometry, grid)
    starts = rng.integers(1, (rows - 1, columns - 1), (50, 2))
    walked = search.best_first_cells(geometry, grid, starts)
    for found in (traversal, walked):
        np.testing.assert_array_equal(found, expected)


def test_brute_force_is_three_dimensional_on_general_meshes() -> None:
    upright = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 0, 10], [1, 0, 10]], [[0, 1, 2], [1, 3, 2]])
    assert search.brute_force_vertex(upright.vertices.T, np.array([0.1, 0.0, 9.0])) == 2
    assert search.brute_force_vertex(upright.vertices.T, np.array([0.1, 0.0, 1.0])) == 0
    assert search.brute_force_vertex(upright.vertices.T, np.array([0.5, 0.0, 0.0])) == 0  # the lower of equal ones


@pytest.mark.parametrize("rings", [1, 2, 3, 4])
@pytest.mark.parametrize("start", [0, 12, 13 * 6 + 6, 13 * 12, 13 * 13 - 1, 13 * 5])
def test_both_searches_and_the_cache_collect_the_same_with_the_triangles_all_of_whose_corners_are_collected(
    rings: int, start: int
) -> None:
    mesh = search.TriangleGraph(grid_triangles(13, 13), 13 * 13)
    queued, united = search.queue_bfs(mesh, start, rings), search.union_bfs(mesh, start, rings)
    cached = search.cached_topology(mesh)
    assert queued == united == cached(start, rings).vertices.tolist()
    assert cached(start, rings) is cached(start, rings)
    patch = search.topology_around(mesh, start, rings, search.queue_bfs)
    np.testing.assert_array_equal(patch.triangles, cached(start, rings).triangles)
    inside = np.isin(mesh.triangles, patch.vertices).all(axis=1)
    np.testing.assert_array_equal(patch.vertices[patch.triangles], mesh.triangles[inside])
    grid = search.GridGraph(13, 13)
    collected = search.queue_bfs(grid, start, rings)
    assert collected == search.union_bfs(grid, start, rings)
    if start == 13 * 6 + 6:  # in the middle: a square (Figure 7), and a hexagon of 1 + 6 (1 + 2 + ... + rings) vertices
        assert (len(collected), len(queued)) == ((2 * rings + 1) ** 2, 1 + 3 * rings * (rings + 1))
