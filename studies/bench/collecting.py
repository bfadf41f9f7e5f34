"""Collecting the vertices of a local collider (Table 5), for one body and for batches."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.report.collect import GridGraph, cached_topology, queue_bfs, topology_around, union_bfs
from studies.bench.measure import Bench, Case
from studies.bench.moving import Waves, general_mesh
from studies.bench.report import BATCHES, RINGS
from studies.bench.template import patch_template

SIDE = 200
REPEATS = 10
RINGS_OF_BATCHES = 2


def measure_one(bench: Bench) -> None:
    """Measure the report's methods on the grid's graph, and on a general mesh with its triangles."""
    graph = GridGraph(SIDE, SIDE)
    mesh = general_mesh(Waves(SIDE))
    cached = cached_topology(mesh)
    vertex = SIDE * SIDE // 2 + SIDE // 2
    for rings in RINGS:
        template = patch_template(rings)
        bench.time(Case("collect", "queue_bfs", SIDE, rings=rings), lambda n=rings: queue_bfs(graph, vertex, n))  # type: ignore[misc]
        bench.time(Case("collect", "union_bfs", SIDE, rings=rings), lambda n=rings: union_bfs(graph, vertex, n))  # type: ignore[misc]
        bench.time(Case("collect", "cached", SIDE, rings=rings), lambda t=template: t.indices(SIDE) + vertex)  # type: ignore[misc]
        bench.time(
            Case("collect", "mesh_triangles", SIDE, rings=rings),
            lambda n=rings: topology_around(mesh, vertex, n),  # type: ignore[misc]
        )
        bench.time(Case("collect", "mesh_cached", SIDE, rings=rings), lambda n=rings: cached(vertex, n))  # type: ignore[misc]


def measure_batches(bench: Bench) -> None:
    """The grid's template for batches: indices of all samples of all patches."""
    template = patch_template(RINGS_OF_BATCHES)
    for count in BATCHES:
        centres = np.linspace(5 * SIDE, SIDE * SIDE - 5 * SIDE, count).astype(np.int64)
        stride = np.ones(count, np.int64)

        def run(centres: np.ndarray = centres, stride: np.ndarray = stride) -> None:
            for _ in range(REPEATS):
                indices = template.indices(SIDE) * stride[:, None]
                indices += centres[:, None]

        bench.time(Case("collect_batch", "cached", SIDE, count, RINGS_OF_BATCHES), run)
