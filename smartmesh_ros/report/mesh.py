"""Patches of general meshes: triangles around the nearest vertex, by the report's methods."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.patches.shapes import ShapeTable
from smartmesh_ros.report.batch import PatchBatch, twists_at
from smartmesh_ros.report.collect import BFS, cached_topology, topology_around
from smartmesh_ros.report.config import ANYWHERE, ReportConfig, require_search_on
from smartmesh_ros.report.search import best_first_vertices, brute_force_vertex, ray_cast, uniform_grid_vertices
from smartmesh_ros.report.supports import Support
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Rings of the largest patch on a general mesh.
MOST_MESH_RINGS = 8


class MeshPatches:
    """Searches and collects the patches of bodies on one general mesh, the tile ``name``."""

    def __init__(self, name: str, mesh: TriangleMesh, stopwatch: Stopwatch) -> None:
        self.mesh = mesh
        self._name = name
        self._stopwatch = stopwatch
        self._cached = cached_topology(mesh)
        self._table: IntArray | None = None

    def select(
        self, chosen: IntArray, shapes: ShapeTable, bodies: FloatArray, reach: FloatArray, time: float,
        duration: float, config: ReportConfig, supports: Any, before: dict[int, PatchBatch],
    ) -> dict[int, PatchBatch]:  # fmt: skip
        """Write the supports of the bodies in ``chosen`` (n,) and return their patches by body. Arguments as in
        `FixedPatches.select`."""
        if config.search not in ANYWHERE:
            require_search_on(config.search, self.mesh.shape)
        positions_w = bodies[chosen, :3]
        with self._stopwatch.stage("search"):
            found = self._search(chosen, positions_w, before, config, supports)
        patches = {}
        with self._stopwatch.stage("collect"):
            for body, vertex, distance in zip(chosen.tolist(), found.tolist(), reach.tolist(), strict=True):
                patches[body] = self._patch(body, vertex, distance, shapes, bodies, time, duration, config, supports)
        return patches

    def _search(
        self,
        bodies: IntArray,
        positions_w: FloatArray,
        before: dict[int, PatchBatch],
        config: ReportConfig,
        supports: Any,
    ) -> IntArray:
        """Return the nearest vertices by the configured method. Best-first search starts at those of ``supports``."""
        method, mesh = config.search, self.mesh
        if method in ("auto", "grid_traversal") and mesh.shape.grid is not None:
            return uniform_grid_vertices(mesh.shape.grid, positions_w)
        if method == "best_first":
            if self._table is None:
                self._table = mesh.graph.padded()
            start = np.clip(supports["column"][bodies], 0, mesh.size - 1)
            return best_first_vertices(mesh, self._table, positions_w, start)
        found = np.full(len(bodies), -1)
        if method == "ray_cast":
            found = self._hits(bodies, positions_w, before)
        for index in np.flatnonzero(found < 0).tolist():
            found[index] = brute_force_vertex(mesh.coordinates, positions_w[index])
        return found

    def _hits(self, bodies: IntArray, positions_w: FloatArray, before: dict[int, PatchBatch]) -> IntArray:
        """Return the vertices that rays from the bodies hit on their last patches, -1 = missed or no patch."""
        found = np.full(len(bodies), -1)
        for index, body in enumerate(bodies.tolist()):
            patch = before.get(body)
            if patch is not None and patch.vertices is not None:
                hit = int(ray_cast(positions_w[index : index + 1], patch.vertices_w, patch.triangles)[0])
                found[index] = patch.vertices[hit] if hit >= 0 else -1
        return found

    def _patch(
        self, body: int, vertex: int, reach: float, shapes: ShapeTable, bodies: FloatArray, time: float,
        duration: float, config: ReportConfig, supports: Any,
    ) -> PatchBatch:  # fmt: skip
        mesh = self.mesh
        rings = config.rings or min(max(math.ceil(reach / mesh.edge_length + 0.5), 1), MOST_MESH_RINGS)
        if config.collect == "cached":
            topology = self._cached(vertex, rings)
        else:
            topology = topology_around(mesh, vertex, rings, BFS[config.collect])
        now = mesh.sample(topology.vertices, time, duration)
        support = supports[body]
        support.row, support.column, support.rows, support.columns, support.stride = 0, vertex, 0, 0, 1
        support.state, support.deviation = Support.MESH, 0.0
        CORE.find_mesh_foot(now.positions, topology.triangles, shapes.core, bodies, body, as_bytes(supports))
        foot = np.array([support.foot_x, support.foot_y, support.foot_z])
        linear, angular = mesh_twist(now.positions - foot, now.velocities, bodies[body, :3] - foot, mesh.edge_length)
        support.slide_x, support.slide_y, support.rise = linear
        support.turn_x, support.turn_y, support.turn_z = angular
        centres = now.positions[np.searchsorted(topology.vertices, [vertex])]
        linear_w, angular_w = twists_at(supports[body : body + 1], centres)
        return PatchBatch(
            tile=self._name, kind=config.mesh_kind, bodies=np.array([body]), triangles=topology.triangles,
            rows=np.array([0]), columns=np.array([vertex]), stride=np.array([1]), deviation=np.zeros(1),
            vertices_w=now.positions[None], centres_w=centres, linear_w=linear_w, angular_w=angular_w,
            vertices=topology.vertices,
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
    if not (np.isfinite(inertia).all() and np.isfinite(moment).all()):  # vertices as far away as numbers reach
        return np.nan_to_num(linear), np.zeros(3)
    # Points along a line leave one rotation undetermined; lstsq sets it to zero.
    angular = np.linalg.lstsq(inertia, moment, rcond=1e-9)[0]
    return linear - np.cross(angular, middle), angular
