"""Patches of general meshes."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.patches.batch import MeshBatch, PatchBatch, SurfaceTwist, mesh_twist
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.collect import BFS, PatchTopology, TopologyCache, topology_around
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.search.best_first import best_first_vertices
from smartmesh_ros.search.brute_force import BruteForce
from smartmesh_ros.search.grid import uniform_grid_vertices
from smartmesh_ros.search.methods import require_search
from smartmesh_ros.search.ray_cast import ray_cast
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Rings of the largest patch of a general mesh.
MOST_RINGS = 8


class MeshPatches:
    """Searches and collects the patches of bodies on one general mesh, a batch per body."""

    def __init__(self, mesh: TriangleMesh, config: PatchConfig, stopwatch: Stopwatch) -> None:
        self.mesh = mesh
        self.config = config
        self._stopwatch = stopwatch
        self._brute_force = BruteForce(mesh.size)
        self._cache = TopologyCache(mesh)
        self._table: IntArray | None = None
        self._vertex = np.empty(0, np.int64)  # nearest vertex at the update before, -1 = none

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, {"_vertex": -1}, kept)

    def patches(
        self,
        name: str,
        bodies: IntArray,
        positions_w: FloatArray,
        reach: FloatArray,
        time: float,
        before: list[PatchBatch],
    ) -> list[PatchBatch]:
        """Patches of the mesh, tile ``name``, at ``time`` [s]; arguments as in `GridPatches.patches`."""
        require_search(self.config.search, self.mesh)
        with self._stopwatch.stage("search"):
            found = self._search(bodies, positions_w, before)
        self._vertex[bodies] = found
        with self._stopwatch.stage("collect"):
            return [
                self._batch(name, body, position_w, vertex, distance, time)
                for body, position_w, vertex, distance in zip(
                    bodies.tolist(), positions_w, found.tolist(), reach.tolist(), strict=True
                )
            ]

    def _search(self, bodies: IntArray, positions_w: FloatArray, before: list[PatchBatch]) -> IntArray:
        """Nearest vertices by the chosen method."""
        method, mesh = self.config.search, self.mesh
        if method == "grid_traversal":
            assert mesh.shape.grid is not None
            return uniform_grid_vertices(mesh.shape.grid, positions_w)
        if method == "best_first":
            if self._table is None:
                self._table = mesh.graph.padded()
            start = np.maximum(self._vertex[bodies], 0)
            return best_first_vertices(mesh, self._table, positions_w, start)
        found = np.full(len(bodies), -1)
        if method == "ray_cast":
            found = self._hits(bodies, positions_w, before)
        for index in np.flatnonzero(found < 0).tolist():
            found[index] = self._brute_force.nearest(mesh.coordinates, positions_w[index])
        return found

    def _hits(self, bodies: IntArray, positions_w: FloatArray, before: list[PatchBatch]) -> IntArray:
        """Vertices that rays from the bodies hit on the patches they had, -1 = missed or none."""
        had = {int(batch.bodies[0]): batch for batch in before if isinstance(batch, MeshBatch)}
        found = np.full(len(bodies), -1)
        for index, body in enumerate(bodies.tolist()):
            batch = had.get(body)
            if batch is not None:
                hit = int(ray_cast(positions_w[index : index + 1], batch.positions_w, batch.triangles)[0])
                found[index] = batch.vertices[hit] if hit >= 0 else -1
        return found

    def _batch(
        self, name: str, body: int, position_w: FloatArray, vertex: int, reach: float, time: float
    ) -> PatchBatch:
        mesh = self.mesh
        rings = self.config.rings or min(max(math.ceil(reach / mesh.edge_length + 0.5), 1), MOST_RINGS)
        topology = self._topology(vertex, rings)
        samples = mesh.sample(topology.vertices, time)
        centre = samples.positions[np.searchsorted(topology.vertices, vertex)]
        linear = angular = np.zeros(3)
        if samples.velocities is not None:
            offsets, edge = samples.positions - centre, mesh.edge_length
            linear, angular = mesh_twist(offsets, samples.velocities, position_w - centre, edge)
        return MeshBatch(
            tile=name,
            kind=self.config.mesh_kind,
            bodies=np.array([body]),
            triangles=topology.triangles,
            rows=np.array([0]),
            columns=np.array([vertex]),
            stride=np.array([1]),
            centres_w=centre[None],
            surface=SurfaceTwist(linear[None], angular[None]),
            deviation=np.zeros(1),
            mesh=mesh,
            positions_w=samples.positions[None],
            vertices=topology.vertices,
            points_w=np.array([[*position_w[:2], centre[2]]]),
        )

    def _topology(self, vertex: int, rings: int) -> PatchTopology:
        if self.config.collect == "cached":
            return self._cache.around(vertex, rings)
        return topology_around(self.mesh, vertex, rings, BFS[self.config.collect])
