"""Simple-Mesh: one collider of each whole main mesh, the baseline that the report compares its patches with.

It ignores the ground's velocity, and its cost grows with the map instead of the bodies. For studies only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.height_field import quarter_turn
from smartmesh_ros.report.config import WholeKind, require_whole
from smartmesh_ros.report.made import HOLE, Field, make_field, make_mesh
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import grid_triangles


class WholeMesh:
    """Colliders of the whole terrain, shared by every body of the world."""

    def __init__(self, client: Any, terrain: Terrain) -> None:
        self._client = client
        self._terrain = terrain
        self._bodies: dict[str, tuple[MainMesh, int]] = {}  # by tile: mesh and body
        self._fields: dict[str, Field] = {}  # by tile
        self._states: dict[str, tuple[int, bool]] = {}  # by tile: version and True if it moved, at the last update
        self._kind: WholeKind | None = None

    def update(self, kind: WholeKind, time: float) -> None:
        """Set the colliders to the ground at ``time`` [s]: a trimesh is rebuilt, a heightfield replaced in place.

        Raises `InputError` if that is impossible (see `require_whole`).
        """
        for mesh in self._terrain.tiles.values():
            require_whole(kind, mesh)
        if kind != self._kind:
            self.release()
            self._kind = kind
        for name, (mesh, _) in list(self._bodies.items()):
            if self._terrain.tiles.get(name) is not mesh:
                self._remove(name)
        for name, mesh in self._terrain.tiles.items():
            moving = mesh.moving(time)
            if name in self._bodies and not moving and self._states.get(name) == (mesh.version, False):
                continue
            if kind == "whole_heightfield":
                self._replace(name, mesh, time)
            else:
                self._rebuild(name, mesh, time)
            self._states[name] = (mesh.version, moving)

    def has(self, body: int) -> bool:
        """Return True if a PyBullet body is one of the colliders."""
        return any(uid == body for _, uid in self._bodies.values())

    def release(self) -> None:
        """Remove all whole colliders."""
        for name in list(self._bodies):
            self._remove(name)

    def _remove(self, name: str) -> None:
        self._client.removeBody(self._bodies[name][1])
        self._fields.pop(name, None)
        del self._bodies[name]

    def _rebuild(self, name: str, mesh: MainMesh, time: float) -> None:
        if isinstance(mesh, HeightMap):
            geometry = mesh.geometry
            rows, columns = np.divmod(np.arange(geometry.size), geometry.columns)
            vertices = np.column_stack([geometry.to_world(rows, columns), _heights(mesh, time).ravel()])
            triangles = grid_triangles(geometry.rows, geometry.columns)
        else:
            vertices, triangles = mesh.sample(np.arange(mesh.size), time).positions, mesh.triangles
        if name in self._bodies:
            self._remove(name)
        self._add(name, mesh, make_mesh(self._client, "trimesh", vertices, triangles.astype(np.int32)).uid)

    def _replace(self, name: str, mesh: MainMesh, time: float) -> None:
        assert isinstance(mesh, HeightMap)
        geometry = mesh.geometry
        if name not in self._fields:
            field = make_field(self._client, geometry.rows, geometry.columns, geometry.resolution, HOLE)
            x, y = geometry.to_world((geometry.rows - 1) / 2, (geometry.columns - 1) / 2).tolist()
            place = (x, y, geometry.origin[2])
            self._client.resetBasePositionAndOrientation(field.uid, place, quarter_turn(geometry.yaw))
            self._add(name, mesh, field.uid)
            self._fields[name] = field
        self._fields[name].replace(self._client, _heights(mesh, time) - geometry.origin[2])

    def _add(self, name: str, mesh: MainMesh, uid: int) -> None:
        with undone(lambda: self._client.removeBody(uid)):
            self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._bodies[name] = mesh, uid


def _heights(heightmap: HeightMap, time: float) -> FloatArray:
    """Return the heights (rows, columns) [m] of a height map at ``time`` [s]."""
    geometry = heightmap.geometry
    return heightmap.sample(np.arange(geometry.size).reshape(geometry.rows, geometry.columns), time).heights
