"""Patches of a general mesh: triangles around the nearest vertex, by the report's methods."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from smartmesh_ros.ground.slot_tables import with_rows
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh
from studies.report.collect import TriangleGraph, cached_topology, topology_around
from studies.report.config import ReportConfig
from studies.report.map_patches import PatchBatch
from studies.report.search import best_first_vertex, brute_force_vertex

# Rings of the largest patch on a general mesh.
MOST_MESH_RINGS = 8


class MeshPatches:
    """Searches and collects the patches of bodies on a general mesh."""

    def __init__(self, mesh: TriangleMesh, config: ReportConfig) -> None:
        self._mesh, self._config = mesh, config
        self._graph = TriangleGraph(mesh.triangles, mesh.size)
        cached = config.collect == "cached"
        self._topology = cached_topology(self._graph) if cached else partial(topology_around, self._graph)
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
        mesh, config = self._mesh, self._config
        for slot, position_w, distance in zip(slots.tolist(), states[:, :3], reach.tolist(), strict=True):
            if config.search == "best_first":
                vertex = best_first_vertex(mesh, self._graph, position_w, int(self._nearest[slot]))
            else:
                vertex = brute_force_vertex(mesh.coordinates, position_w)
            self._nearest[slot] = vertex
            rings = config.rings or min(max(math.ceil(distance / self._edge + 0.5), 1), MOST_MESH_RINGS)
            topology = self._topology(vertex, rings)
            now = mesh.sample(topology.vertices, time, duration)
            foot = now.positions[np.searchsorted(topology.vertices, [vertex])]
            linear, angular = mesh_twist(now.positions - foot, now.velocities, position_w - foot[0], self._edge)
            yield PatchBatch(
                slots=np.array([slot]), triangles=topology.triangles, vertices_w=now.positions[None], centres_w=foot,
                shape=(0, 0), feet_w=foot, linear_w=linear[None], angular_w=angular[None],
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
