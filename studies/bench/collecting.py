"""Collecting the vertices of a local collider (Table 5), for one body and for batches."""

from __future__ import annotations

from functools import partial

import numpy as np

from smartmesh_ros.report.collect import queue_bfs, union_bfs
from smartmesh_ros.terrain.graph import GridGraph
from smartmesh_ros.terrain.grid import IntArray
from studies.bench.measure import Bench, Case
from studies.bench.report import BATCHES, RINGS

SIDE = 200
REPEATS = 10
RINGS_OF_BATCHES = 2


def patch_template(rings: int, columns: int) -> IntArray:
    """Return the offsets (K,) of a patch's samples from its nearest vertex, in a row-major map of ``columns`` columns:
    the cache of the report's Chapter 3 (its Figure 10), which is one for every vertex of a map."""
    offsets = np.arange(-rings, rings + 1)
    return np.asarray((offsets[:, None] * columns + offsets).ravel())


def measure_one(bench: Bench) -> None:
    """Measure the report's methods on the grid's graph."""
    graph = GridGraph(SIDE, SIDE)
    vertex = SIDE * SIDE // 2 + SIDE // 2
    for rings in RINGS:
        template = patch_template(rings, SIDE)
        methods = {
            "queue_bfs": partial(queue_bfs, graph, vertex, rings),
            "union_bfs": partial(union_bfs, graph, vertex, rings),
            "cached": partial(np.add, template, vertex),
        }
        for method, run in methods.items():
            bench.time(Case("collect", method, SIDE, rings=rings), run)


def measure_batches(bench: Bench) -> None:
    """The grid's template for batches: indices of all samples of all patches."""
    template = patch_template(RINGS_OF_BATCHES, SIDE)
    for count in BATCHES:
        centres = np.linspace(5 * SIDE, SIDE * SIDE - 5 * SIDE, count).astype(np.int64)
        stride = np.ones(count, np.int64)

        def run(centres: np.ndarray = centres, stride: np.ndarray = stride) -> None:
            for _ in range(REPEATS):
                indices = template * stride[:, None]
                indices += centres[:, None]

        bench.time(Case("collect_batch", "cached", SIDE, count, RINGS_OF_BATCHES), run)
