"""Nearest-vertex searches (Table 4) and collecting the vertices of a local collider (Table 5), for one body."""

from collections.abc import Callable
from functools import partial
from itertools import count, cycle
from typing import Any

import numpy as np

from smartmesh_ros import GridGeometry
from smartmesh_ros.terrain.grid import FloatArray
from studies.bench.measure import Bench
from studies.bench.moving import RESOLUTION, Frames, Waves, general_mesh
from studies.bench.report import LARGER, RINGS, SEARCH
from studies.report import search

# Sizes of Table 4, and of height maps, over which a search of a uniform grid is to cost the same.
REPORT_SIDES, MAP_SIDES = tuple(SEARCH["brute_force"]), (50, 100, 200, *LARGER)


def measure_general(bench: Bench, side: int) -> None:
    """One body on a general mesh, a vertex at a time, as in the report; grid traversal on a height map."""
    mesh = general_mesh(Waves(side))
    graph = search.TriangleGraph(mesh.triangles, mesh.size)
    walk = partial(search.best_first_vertex, mesh, graph)
    _measure(bench, "search", side, partial(search.brute_force_vertex, mesh.vertices.T), walk)
    vertex = search.brute_force_vertex(mesh.vertices.T, np.full(3, 0.3 * (side - 1) * RESOLUTION))
    patch = search.topology_around(graph, vertex, 1)
    corners, above = mesh.vertices[patch.vertices], mesh.vertices[vertex] + (0.01, 0.02, 1.0)
    bench.time(("search", "ray_cast", side), lambda: search.ray_cast(above, corners, patch.triangles))


def measure_maps(bench: Bench, side: int) -> None:
    """One body on a height map, through the searches that serve batches."""
    geometry = GridGeometry(rows=side, columns=side, resolution=RESOLUTION)
    _measure(
        bench, "search_map", side,
        lambda position: search.brute_force_cells(geometry, geometry.to_grid(position[None])),
        lambda position, start: search.best_first_cells(geometry, geometry.to_grid(position[None]), start),
    )  # fmt: skip


def _measure(
    bench: Bench, what: str, side: int, brute_force: Callable[[FloatArray], Any], best_first: Callable[..., Any]
) -> None:
    """Measure searches of one body by its position (3,) [m], and by what was found before. The average player moves by
    less than a cell from frame to frame; the worst case teleports between two corners."""
    geometry = GridGeometry(rows=side, columns=side, resolution=RESOLUTION)
    extent = (side - 1) * RESOLUTION
    diagonal = np.array([1.0, 1.0, 0.0])
    average = Frames((0.3 * extent + frame * 0.4 * RESOLUTION) % extent * diagonal for frame in count(1))
    worst = Frames(cycle((0.999 * extent * diagonal, 0.001 * extent * diagonal)))
    bench.time((what, "brute_force", side), lambda: brute_force(average.now), average.next)
    for walk, suffix in ((average, ""), (worst, "_worst")):
        found = [brute_force(walk.now)]

        def step(walk: Frames = walk, found: list[Any] = found) -> None:
            found[0] = best_first(walk.now, found[0])

        def traverse(walk: Frames = walk) -> None:
            search.nearest_vertices(geometry, geometry.to_grid(walk.now[None]))

        bench.time((what, f"best_first{suffix}", side), step, walk.next)
        bench.time((what, f"grid_traversal{suffix}", side), traverse, walk.next)


COLLECT_SIDE = 200


def measure_collecting(bench: Bench) -> None:
    """Measure the report's methods on the grid's graph."""
    graph = search.GridGraph(COLLECT_SIDE, COLLECT_SIDE)
    vertex = COLLECT_SIDE * COLLECT_SIDE // 2 + COLLECT_SIDE // 2
    for rings in RINGS:
        # Offsets of a patch's samples from its nearest vertex: the cache of the report's Figure 10, for all vertices.
        offsets = np.arange(-rings, rings + 1)
        template = (offsets[:, None] * COLLECT_SIDE + offsets).ravel()
        methods = {
            "queue_bfs": partial(search.queue_bfs, graph, vertex, rings),
            "union_bfs": partial(search.union_bfs, graph, vertex, rings),
            "cached": partial(np.add, template, vertex),
        }
        for method, run in methods.items():
            bench.time(("collect", method, rings), run)
