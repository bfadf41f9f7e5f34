"""Simple-Mesh: one collider of the whole height map, the baseline that the report compares its patches with.

It ignores the ground's velocity, and its cost grows with the map instead of the bodies.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.shown_ground import quarter_turn
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.report.config import WholeKind
from studies.report.made import HOLE, Field, make_field, make_mesh


class WholeMesh:
    """A collider of the whole height map, shared by every body of the world. Its size stays the same."""

    def __init__(self, client: Any, kind: WholeKind) -> None:
        self._client, self._kind = client, kind
        self._uid = -1  # of its body
        self._field: Field | None = None
        # The map and its version at the last update, and True if it moved.
        self._state: tuple[HeightMap | None, int, bool] = (None, 0, True)

    def update(self, ground: Any, time: float) -> None:
        """Set the collider to a map at ``time`` [s]: a trimesh is rebuilt, a heightfield replaced in place."""
        state = ground, ground.version, ground.moving(time)
        if state == self._state and not state[2]:
            return
        if ground is not self._state[0]:
            self.release()
        geometry = ground.geometry
        rows, columns = np.divmod(np.arange(geometry.size), geometry.columns)
        heights = ground.sample(np.arange(geometry.size), time).heights
        if self._kind == "whole_heightfield":
            self._replace(ground, heights.reshape(geometry.rows, geometry.columns) - geometry.origin[2])
        else:
            self.release()
            vertices = np.column_stack([geometry.to_world(rows, columns), heights])
            triangles = grid_triangles(geometry.rows, geometry.columns).astype(np.int32)
            self._hold(make_mesh(self._client, "trimesh", vertices, triangles).uid)
        self._state = state

    def release(self) -> None:
        """Remove the collider."""
        if self._uid >= 0:
            self._client.removeBody(self._uid)
        self._uid, self._field, self._state = -1, None, (None, 0, True)

    def _replace(self, ground: HeightMap, heights: Any) -> None:
        geometry = ground.geometry
        if self._field is None:
            self._field = make_field(self._client, geometry.rows, geometry.columns, geometry.resolution, HOLE)
            x, y = geometry.to_world((geometry.rows - 1) / 2, (geometry.columns - 1) / 2).tolist()
            place = (x, y, geometry.origin[2])
            self._client.resetBasePositionAndOrientation(self._field.uid, place, quarter_turn(geometry.yaw))
            self._hold(self._field.uid)
        self._field.replace(self._client, heights)

    def _hold(self, uid: int) -> None:
        self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._uid = uid
