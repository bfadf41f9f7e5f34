"""Simple-Mesh: one collider of the whole main mesh, the baseline that the report compares its patches with.

It ignores the ground's velocity, and its cost grows with the map instead of the bodies. For studies only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.ground.shown_ground import quarter_turn
from smartmesh_ros.report.config import WholeKind
from smartmesh_ros.report.made import HOLE, Field, make_field, make_mesh
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import grid_triangles


class WholeMesh:
    """A collider of the whole main mesh, shared by every body of the world. PyBullet must be able to make it (see
    `require_whole`)."""

    def __init__(self, client: Any, kind: WholeKind) -> None:
        self._client, self._kind = client, kind
        self._uid = -1  # of its body
        self._field: Field | None = None
        # The mesh and its version at the last update, and True if it moved.
        self._state: tuple[MainMesh | None, int, bool] = (None, 0, True)

    def update(self, mesh: MainMesh, time: float) -> None:
        """Set the collider to a mesh at ``time`` [s]: a trimesh is rebuilt, a heightfield replaced in place."""
        state = mesh, mesh.version, mesh.moving(time)
        if state == self._state and not state[2]:
            return
        if mesh is not self._state[0]:
            self.release()
        if isinstance(mesh, HeightMap) and self._kind == "whole_heightfield":
            self._replace(mesh, time)
        else:
            self._rebuild(mesh, time)
        self._state = state

    def has(self, body: int) -> bool:
        """Return True if a PyBullet body is the collider."""
        return body == self._uid

    def release(self) -> None:
        """Remove the collider."""
        if self._uid >= 0:
            self._client.removeBody(self._uid)
        self._uid, self._field, self._state = -1, None, (None, 0, True)

    def _rebuild(self, mesh: MainMesh, time: float) -> None:
        if isinstance(mesh, HeightMap):
            geometry = mesh.geometry
            rows, columns = np.divmod(np.arange(geometry.size), geometry.columns)
            vertices = np.column_stack([geometry.to_world(rows, columns), _heights(mesh, time).ravel()])
            triangles = grid_triangles(geometry.rows, geometry.columns)
        else:
            vertices, triangles = mesh.sample(np.arange(mesh.size), time).positions, mesh.triangles
        self.release()
        self._hold(make_mesh(self._client, "trimesh", vertices, triangles.astype(np.int32)).uid)

    def _replace(self, heightmap: HeightMap, time: float) -> None:
        geometry = heightmap.geometry
        if self._field is None:
            field = make_field(self._client, geometry.rows, geometry.columns, geometry.resolution, HOLE)
            x, y = geometry.to_world((geometry.rows - 1) / 2, (geometry.columns - 1) / 2).tolist()
            place = (x, y, geometry.origin[2])
            self._client.resetBasePositionAndOrientation(field.uid, place, quarter_turn(geometry.yaw))
            self._hold(field.uid)
            self._field = field
        self._field.replace(self._client, _heights(heightmap, time) - geometry.origin[2])

    def _hold(self, uid: int) -> None:
        with undone(lambda: self._client.removeBody(uid)):
            self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._uid = uid


def _heights(heightmap: HeightMap, time: float) -> FloatArray:
    """Return the heights (rows, columns) [m] of a height map at ``time`` [s]."""
    geometry = heightmap.geometry
    return heightmap.sample(np.arange(geometry.size).reshape(geometry.rows, geometry.columns), time).heights
