"""Patches by the report's methods. On a height map: squares of samples around the nearest one, of as many rings as the
settings or the body's size require; on a general mesh: triangles around the nearest vertex."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros import HeightMap
from smartmesh_ros.core import CORE
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from studies.report.config import ReportConfig
from studies.report.search import (
    TriangleGraph,
    best_first_vertex,
    brute_force_vertex,
    cached_topology,
    nearest_vertices,
    topology_around,
)

# Rings of the largest patch, beyond which bodies get a coarser stride: of a field (65 x 65 samples, which PyBullet
# replaces in about two milliseconds), and of the report's largest collider (9 x 9).
MOST_RINGS, MOST_GRID_RINGS = 32, 4


class MapPatches:
    """Searches and collects the patches of bodies on a height map."""

    def __init__(self, heightmap: HeightMap, config: ReportConfig) -> None:
        self._map, self._config = heightmap, config
        # By slot: rings around the centre, stride from ring to ring [samples], and the least and most reach for which a
        # patch keeps this size [m].
        self._extents = np.zeros((0, 4))

    def around(
        self, slots: IntArray, states: FloatArray, reach: FloatArray, time: float, duration: float
    ) -> Iterator[PatchBatch]:
        """Yield the patches of the bodies in ``slots`` (n,), by their ``states`` (n, 13), for the ``duration`` [s] from
        ``time`` [s] on, without those that are holes alone. ``reach`` (n,) [m]: about each body's centre, within which
        it can touch ground in that time."""
        self._set_extents(slots, reach)
        placed = self._map.placed_at(time)
        nearest = nearest_vertices(placed, placed.to_grid(states[:, :2]))
        rings = self._extents[slots, 0].astype(np.int64)
        for size in np.unique(rings).tolist():
            chosen = np.flatnonzero(rings == size)
            batch = self._batch(size, slots[chosen], nearest[chosen], states[chosen], time, duration)
            if len(batch.slots):
                yield batch

    def _set_extents(self, slots: IntArray, reach: FloatArray) -> None:
        """Grow patches at once, but shrink them only well below their size, so that no patch alternates between two
        sizes. A body that needs more than the most rings gets a coarser stride. A patch is never larger than the map,
        nor of more rings than the settings say, if they do."""
        missing = max(int(slots.max()) + 1 - len(self._extents), 0)
        self._extents = np.concatenate([self._extents, np.tile((0.0, 0.0, 0.0, -1.0), (missing, 1))])
        _, _, least, most = self._extents[slots].T
        outgrown = (reach > most) | (reach < least)
        geometry, config = self._map.geometry, self._config
        room = (min(geometry.rows, geometry.columns) - 1) // 2
        extent = np.tile(np.array([min(config.rings, room), 1.0, 0.0, np.inf]), (int(outgrown.sum()), 1))
        if not config.rings:
            most_rings = MOST_RINGS if config.kind == "heightfield" else MOST_GRID_RINGS
            # Half a cell more, because the patch is centred on the nearest vertex instead of the body.
            cells = np.ceil(reach[outgrown] / geometry.resolution + 0.5 - 1e-9).astype(np.int64).clip(1, room)
            stride = -(-cells // most_rings)
            rings = np.maximum(np.minimum(-(-cells // stride), room // stride), 1)
            covered = rings * stride
            most = np.where(covered + stride > room, np.inf, (covered - 0.5) * geometry.resolution)
            extent = np.stack([rings, stride, (covered - stride - 1.0) * geometry.resolution, most], axis=1)
        self._extents[slots[outgrown]] = extent

    def _batch(
        self, rings: int, slots: IntArray, nearest: IntArray, states: FloatArray, time: float, duration: float
    ) -> PatchBatch:
        """Return the patches of as many ``rings`` around the ``nearest`` samples (n, 2), row and column."""
        geometry, placed, side = self._map.geometry, self._map.placed_at(time), 2 * rings + 1
        stride = self._extents[slots, 1].astype(np.int64)[:, None]
        # One patch away from the edge, so that every patch is complete.
        room = rings * stride
        first = np.maximum(np.minimum(nearest, geometry.last.astype(np.int64) - room), room) - room
        steps = np.stack(np.divmod(np.arange(side * side), side), axis=1)
        cells = first[:, None] + steps * stride[:, None]
        rows, columns = cells[..., 0], cells[..., 1]
        samples = self._map.sample(rows * geometry.columns + columns, time, duration)
        vertices = np.concatenate([placed.to_world(rows, columns), samples.heights[..., None]], axis=2)
        square = (-1, side, side)
        feet, linear, angular = self._feet(
            first, stride[:, 0], states[:, :2], samples.heights.reshape(square), samples.velocities.reshape(square),
            time,
        )  # fmt: skip
        there = np.flatnonzero(np.isfinite(samples.heights).any(axis=1))
        centres = vertices[:, side * side // 2].copy()
        centres[:, 2] = np.where(np.isnan(centres[:, 2]), feet[:, 2], centres[:, 2])
        return PatchBatch(
            slots=slots[there], triangles=grid_triangles(side, side).astype(np.int32), vertices_w=vertices[there],
            centres_w=centres[there], shape=(side, side), feet_w=feet[there], linear_w=linear[there],
            angular_w=angular[there],
        )  # fmt: skip

    def _feet(
        self, first: IntArray, stride: IntArray, places_w: FloatArray, heights: FloatArray, velocities: FloatArray,
        time: float,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
        """Return the ground under bodies at ``places_w`` (n, 2) [m], its velocity and angular velocity, (n, 3) each,
        from the samples (n, side, side) of their squares, which begin at ``first`` (n, 2)."""
        side, placed = heights.shape[1], self._map.placed_at(time)
        place = np.clip((placed.to_grid(places_w) - first) / stride[:, None], 0.0, side - 1.0)
        row, column = np.minimum(place.astype(np.int64), side - 2).T
        v, u = place[:, 0] - row, place[:, 1] - column
        z, _, _ = _in_facet(heights, row, column, u, v)
        rise, along, down = _in_facet(velocities, row, column, u, v)
        holes = np.isnan(z)
        if holes.any():
            known = ~np.isnan(heights[holes])
            count = np.maximum(known.sum(axis=(1, 2)), 1)
            z[holes] = np.where(known, heights[holes], 0.0).sum(axis=(1, 2)) / count
            rise[holes] = np.where(known, np.nan_to_num(velocities[holes]), 0.0).sum(axis=(1, 2)) / count
            along[holes] = down[holes] = 0.0
        x, y, cos, sin, slide_x, slide_y, spin = CORE.grid_pose(self._map.core_reader, time)
        size = placed.resolution * stride
        east, north = (along * cos - down * sin) / size, (along * sin + down * cos) / size
        east_of, north_of = places_w[:, 0] - x, places_w[:, 1] - y
        linear = np.stack([slide_x - spin * north_of, slide_y + spin * east_of, rise], axis=1)
        angular = np.stack([north, -east, np.full_like(rise, spin)], axis=1)
        return np.column_stack([places_w, z]), linear, angular


def _in_facet(
    samples: FloatArray, row: IntArray, column: IntArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values (n,) in the facet of a cell at ``u``, ``v``, and their changes per column and per row."""
    n, below = np.arange(len(samples)), u < v
    a, e = samples[n, row, column], samples[n, row + 1, column + 1]
    b = np.where(below, samples[n, row + 1, column], samples[n, row, column + 1])
    along, down = np.where(below, e - b, b - a), np.where(below, b - a, e - b)
    return a + along * u + down * v, along, down


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchBatch:
    """Patches of n bodies with the same triangles.

    ``slots``: of the bodies (n,). ``triangles``: corners (T, 3) as indices into the K vertices of a patch.
    ``vertices_w`` (n, K, 3) [m]: z is NaN at holes. ``centres_w`` (n, 3) [m]: the nearest vertex. ``shape``: rows and
    columns of the vertices; (0, 0) on a general mesh. ``feet_w`` (n, 3) [m]: the ground under the bodies' middles, on a
    general mesh the nearest vertices. ``linear_w`` [m/s], ``angular_w`` [rad/s]: mean velocity and angular velocity of
    the ground there until the next refresh (n, 3).
    """

    slots: IntArray
    triangles: NDArray[np.int32]
    vertices_w: FloatArray
    centres_w: FloatArray
    shape: tuple[int, int]
    feet_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray


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
        self._nearest: defaultdict[int, int] = defaultdict(int)  # vertices by slot, at which best-first search starts

    def around(
        self, slots: IntArray, states: FloatArray, reach: FloatArray, time: float, duration: float
    ) -> Iterator[PatchBatch]:
        """Yield the patches, one in each batch; arguments as of `MapPatches.around`."""
        mesh, config = self._mesh, self._config
        for slot, position_w, distance in zip(slots.tolist(), states[:, :3], reach.tolist(), strict=True):
            if config.search == "best_first":
                vertex = best_first_vertex(mesh, self._graph, position_w, self._nearest[slot])
            else:
                vertex = brute_force_vertex(mesh.vertices.T, position_w)
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


# Largest speed that sizes patches [m/s], because a teleported body has no real speed.
FASTEST = 50.0


class ChosenPatches:
    """The patches of the followers on a main mesh, as of the last refresh: ``batches``."""

    def __init__(self, config: ReportConfig, followers: Followers) -> None:
        self.batches: list[PatchBatch] = []
        self._config, self._followers = config, followers
        self._mesh: MainMesh | None = None

    def refresh(self, mesh: MainMesh, time: float, duration: float, states: FloatArray) -> None:
        """Choose the patches of the bodies, with ``states`` (S, 13) by slot, on a mesh at ``time`` [s] for a
        ``duration`` [s]; none if bodies stand on one collider of the whole mesh. Those are left out that are nowhere,
        or so far beside the mesh that they do not touch it."""
        if mesh is not self._mesh:
            self._mesh = mesh
            self._patches: MapPatches | MeshPatches = (
                MapPatches(mesh, self._config) if isinstance(mesh, HeightMap) else MeshPatches(mesh, self._config)
            )
        self.batches = []
        radii, slots = np.zeros(len(states)), np.flatnonzero(np.isfinite(states).all(axis=1))
        radii[slots] = [self._followers[slot].radius for slot in slots.tolist()]
        slots = slots[_beyond(mesh, states[slots]) <= radii[slots]]
        if slots.size and not self._config.whole:
            speeds = np.minimum(np.linalg.norm(states[slots, 7:10], axis=1), FASTEST)
            reach = radii[slots] + speeds * duration
            self.batches = list(self._patches.around(slots, states[slots], reach, time, duration))


def _beyond(mesh: MainMesh, xy_w: FloatArray) -> FloatArray:
    """Return the distance of points (N, 2+) [m] beyond the edge of a map, or the horizontal bounds of a mesh (N,) [m];
    zero or less inside."""
    if isinstance(mesh, HeightMap):
        grid, resolution = mesh.geometry.to_grid(xy_w), mesh.geometry.resolution
        return np.asarray(resolution * np.maximum(-grid, grid - mesh.geometry.last).max(axis=1))
    low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
    return np.asarray(np.maximum(low - xy_w[:, :2], xy_w[:, :2] - high).max(axis=1))
