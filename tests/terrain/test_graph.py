"""Graphs of main meshes have the patterns of the report's figures."""

import numpy as np
import pytest

from smartmesh_ros.report.collect import GridGraph
from smartmesh_ros.terrain.mesh_shape import TriangleGraph
from smartmesh_ros.terrain.trimesh import grid_triangles


def test_the_triangle_graph_of_a_small_mesh_is_that_of_figure_4() -> None:
    graph = TriangleGraph(grid_triangles(3, 3), 9)
    assert graph.neighbours(0) == [1, 3, 4]
    assert graph.neighbours(6) == [3, 7]  # the other corner has two neighbours only
    assert graph.neighbours(2) == [1, 5]
    assert graph.neighbours(8) == [4, 5, 7]
    assert graph.neighbours(4) == [0, 1, 3, 5, 7, 8]


def test_the_grid_graph_of_a_small_mesh_is_that_of_figure_6() -> None:
    graph = GridGraph(3, 3)
    assert graph.neighbours(4) == [0, 1, 2, 3, 5, 6, 7, 8]
    assert graph.neighbours(0) == [1, 3, 4]
    assert graph.neighbours(6) == [3, 4, 7]
    assert graph.neighbours(1) == [0, 2, 3, 4, 5]


@pytest.mark.parametrize("graph", [TriangleGraph(grid_triangles(7, 5), 35), GridGraph(7, 5)])
def test_neighbours_are_mutual_and_ascending(graph: TriangleGraph | GridGraph) -> None:
    for vertex in range(35):
        neighbours = graph.neighbours(vertex)
        assert neighbours == sorted(set(neighbours))
        assert vertex not in neighbours
        assert all(vertex in graph.neighbours(other) for other in neighbours)


def test_the_padded_table_says_the_same() -> None:
    graph = TriangleGraph(grid_triangles(7, 5), 35)
    for vertex, row in enumerate(graph.padded()):
        assert sorted(set(row.tolist()) - {vertex}) == graph.neighbours(vertex)


def test_vertices_beyond_16_bits_are_counted_right() -> None:
    rows = columns = 300
    graph = TriangleGraph(grid_triangles(rows, columns), rows * columns)
    vertex = 250 * columns + 251
    steps = (-columns - 1, -columns, -1, 1, columns, columns + 1)
    assert graph.neighbours(vertex) == [vertex + step for step in steps]
    assert graph.targets.max() == rows * columns - 1 > 65_535
    assert np.diff(graph.offsets).max() == 6
