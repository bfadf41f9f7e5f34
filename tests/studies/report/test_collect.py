"""Collecting: every method collects the same vertices, in the patterns of the report's figures."""

import numpy as np
import pytest

from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.report.search import GridGraph, TriangleGraph, cached_topology, queue_bfs, topology_around, union_bfs


def flat_mesh(side: int) -> TriangleGraph:
    return TriangleGraph(grid_triangles(side, side), side * side)


@pytest.mark.parametrize("rings", [1, 2, 3, 4])
@pytest.mark.parametrize("start", [0, 12, 13 * 6 + 6, 13 * 12, 13 * 13 - 1, 13 * 5])
def test_both_searches_and_the_cache_collect_the_same_with_the_triangles_all_of_whose_corners_are_collected(
    rings: int, start: int
) -> None:
    mesh = flat_mesh(13)
    queued, united = queue_bfs(mesh, start, rings), union_bfs(mesh, start, rings)
    cached = cached_topology(mesh)
    assert queued == united == cached(start, rings).vertices.tolist()
    assert cached(start, rings) is cached(start, rings)
    patch = topology_around(mesh, start, rings, queue_bfs)
    np.testing.assert_array_equal(patch.triangles, cached(start, rings).triangles)
    inside = np.isin(mesh.triangles, patch.vertices).all(axis=1)
    np.testing.assert_array_equal(patch.vertices[patch.triangles], mesh.triangles[inside])
    grid = GridGraph(13, 13)
    collected = queue_bfs(grid, start, rings)
    assert collected == union_bfs(grid, start, rings)
    if start == 13 * 6 + 6:  # in the middle: a square (Figure 7), and a hexagon of 1 + 6 (1 + 2 + ... + rings) vertices
        assert (len(collected), len(queued)) == ((2 * rings + 1) ** 2, 1 + 3 * rings * (rings + 1))
