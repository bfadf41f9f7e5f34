"""Patches of a general mesh: triangles around the nearest vertex, by the report's methods."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from smartmesh_ros.ground.slot_tables import with_rows
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh
from studies.report.batch import PatchBatch
from studies.report.collect import TriangleGraph, cached_topology, topology_around
from studies.report.config import ReportConfig
from studies.report.search import best_first_vertices, brute_force_vertex

# Rings of the largest patch on a general mesh.
MOST_MESH_RINGS = 8


class MeshPatches:
    """Searches and collects the patches of bodies on a general mesh."""

    def __init__(self, mesh: TriangleMesh, config: ReportConfig) -> None:
        self._mesh, self._config = mesh, config
        self._graph = TriangleGraph(mesh.triangles, mesh.size)
        self._cached = cached_topology(self._graph)
        self._neighbours = self._graph.padded()
        first, second = mesh.vertices[mesh.triangles[:, 0]], mesh.vertices[mesh.triangles[:, 1]]
        self._edge = float(np.linalg.norm(first - second, axis=1).mean())
        self._nearest = np.zeros(0, np.int64)  # vertices by slot, at which best-first search starts

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self._nearest = with_rows(self._nearest, slots, 0)

    def around(
        self, slots: IntArray, states: FloatArray, reach: FloatArray, time: float, duration: float
    ) -> Iterator[PatchBatch]:
        """Yield the patches, one in each batch; arguments as of `MapPatches.around`."""
        self._nearest[slots] = found = self._search(self._nearest[slots], states[:, :3])
        for index, (vertex, distance) in enumerate(zip(found.tolist(), reach.tolist(), strict=True)):
            yield self._patch(slots[index : index + 1], vertex, distance, states[index, :3], time, duration)

    def _search(self, starts: IntArray, positions_w: FloatArray) -> IntArray:
        """Return the vertices (n,) nearest to positions (n, 3) [m] by the configured method."""
        if self._config.search == "best_first":
            return best_first_vertices(self._mesh, self._neighbours, positions_w, starts)
        return np.array([brute_force_vertex(self._mesh.coordinates, position) for position in positions_w], np.int64)

    def _patch(
        self, slot: IntArray, vertex: int, reach: float, position_w: FloatArray, time: float, duration: float
    ) -> PatchBatch:
        rings = self._config.rings or min(max(math.ceil(reach / self._edge + 0.5), 1), MOST_MESH_RINGS)
        found = self._cached(vertex, rings) if self._config.collect == "cached" else None
        topology = found or topology_around(self._graph, vertex, rings)
        now = self._mesh.sample(topology.vertices, time, duration)
        foot = now.positions[np.searchsorted(topology.vertices, [vertex])]
        linear, angular = mesh_twist(now.positions - foot, now.velocities, position_w - foot[0], self._edge)
        return PatchBatch(
            slots=slot, triangles=topology.triangles, vertices_w=now.positions[None], centres_w=foot, shape=(0, 0),
            feet_w=foot, linear_w=linear[None], angular_w=angular[None],
        )  # fmt: skip


def mesh_twist(
    offsets: FloatArray, velocities: FloatArray, body: FloatArray, edge: float
) -> tuple[FloatArray, FloatArray]:
    """Twist of the rigid motion nearest to the ``velocities`` (k, 3) of points at ``offsets`` (k, 3) from a centre.

    Least squares, weighted towards the position of the ``body`` (3,) from that centre [m]: at a distance of one
    ``edge`` [m] the weight is a seventh. A plain mean over the patch would be wrong where the velocity field is curved.
    """
    distance = np.einsum("ij,ij->i", offsets - body, offsets - body)
    weight = np.exp(-2.0 * (distance - distance.min()) / (edge * edge))[:, None]
    share = weight / weight.sum()
    middle, linear = (share * offsets).sum(axis=0), (share * velocities).sum(axis=0)
    arm, swing = offsets - middle, velocities - linear
    inertia = (share * arm * arm).sum() * np.eye(3) - (share * arm).T @ arm
    moment = (share * np.cross(arm, swing)).sum(axis=0)
    # Points along a line leave one rotation undetermined; lstsq sets it to zero.
    angular = np.linalg.lstsq(inertia, moment, rcond=1e-9)[0]
    return linear - np.cross(angular, middle), angular
