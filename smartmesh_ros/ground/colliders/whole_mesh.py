"""Simple-Mesh: one collider of each whole main mesh, the baseline that the report compares its patches with.

It ignores the ground's velocity, and its cost grows with the map instead of the bodies. For studies only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.colliders.field import HOLE, quarter_turn
from smartmesh_ros.ground.undone import undone
from smartmesh_ros.patches.config import WholeKind
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import grid_triangles

# Largest arrays that PyBullet accepts.
MOST_VERTICES = 131_072
MOST_INDICES = 524_288


def require_whole(kind: WholeKind, mesh: MainMesh) -> None:
    """Raise `InputError` if PyBullet cannot make one collider of a whole mesh."""
    if kind == "whole_heightfield" and not isinstance(mesh, HeightMap):
        raise InputError("parameter", "a general mesh is no heightfield; use patch.kind 'whole_trimesh' or 'trimesh'")
    if kind == "whole_trimesh":
        indices = 6 * mesh.size if isinstance(mesh, HeightMap) else mesh.triangles.size
        if mesh.size > MOST_VERTICES or indices > MOST_INDICES:
            raise InputError(
                "size",
                f"PyBullet takes no trimesh of {mesh.size} vertices (at most about {MOST_INDICES // 6} of a grid); use "
                "patch.kind 'whole_heightfield', or 'auto' for a patch per body",
            )


class WholeMesh:
    """Colliders of the whole terrain, shared by every body of the world."""

    def __init__(self, client: Any, terrain: Terrain) -> None:
        self._client = client
        self._terrain = terrain
        self._colliders: dict[str, tuple[MainMesh, int, int]] = {}  # by tile: mesh, shape and body
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
        for name in [
            name for name, (mesh, _, _) in self._colliders.items() if self._terrain.tiles.get(name) is not mesh
        ]:
            self._remove(name)
        for name, mesh in self._terrain.tiles.items():
            moving = mesh.moving(time)
            if name in self._colliders and not moving and self._states.get(name) == (mesh.version, False):
                continue
            if kind == "whole_heightfield":
                self._replace(name, mesh, time)
            else:
                self._rebuild(name, mesh, time)
            self._states[name] = (mesh.version, moving)

    def release(self) -> None:
        """Remove all whole colliders."""
        for name in list(self._colliders):
            self._remove(name)

    def _remove(self, name: str) -> None:
        self._client.removeBody(self._colliders[name][2])
        del self._colliders[name]

    def _rebuild(self, name: str, mesh: MainMesh, time: float) -> None:
        if isinstance(mesh, HeightMap):
            vertices, triangles = whole_vertices(mesh, time), grid_triangles(mesh.geometry.rows, mesh.geometry.columns)
        else:
            vertices, triangles = mesh.sample(np.arange(mesh.size), time).positions, mesh.triangles
        if name in self._colliders:
            self._remove(name)
        shape = self._client.createCollisionShape(
            pb.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=triangles.ravel().tolist(),
            flags=pb.GEOM_FORCE_CONCAVE_TRIMESH,
        )
        self._colliders[name] = (mesh, shape, self._create(shape, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))

    def _replace(self, name: str, mesh: MainMesh, time: float) -> None:
        assert isinstance(mesh, HeightMap)
        geometry = mesh.geometry
        heights = np.nan_to_num(whole_vertices(mesh, time)[:, 2] - geometry.origin[2], nan=-HOLE)
        rotated = np.rot90(heights.reshape(geometry.rows, geometry.columns)).ravel()
        rows, columns = geometry.columns, geometry.rows  # of the collider, which is rotated by 90 degrees
        if name not in self._colliders:
            bounds = np.zeros(geometry.size)
            bounds[0], bounds[-1] = -HOLE, HOLE
            # PyBullet's first index runs along its x axis, although the argument is called columns.
            shape = self._client.createCollisionShape(
                pb.GEOM_HEIGHTFIELD,
                meshScale=[geometry.resolution, geometry.resolution, 1.0],
                heightfieldData=bounds.tolist(),
                numHeightfieldRows=columns,
                numHeightfieldColumns=rows,
            )
            middle = geometry.to_world((geometry.rows - 1) / 2, (geometry.columns - 1) / 2)
            position = (float(middle[0]), float(middle[1]), geometry.origin[2])
            self._colliders[name] = (mesh, shape, self._create(shape, position, quarter_turn(geometry.yaw)))
        self._client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD,
            heightfieldData=rotated.tolist(),
            numHeightfieldRows=columns,
            numHeightfieldColumns=rows,
            replaceHeightfieldIndex=self._colliders[name][1],
        )

    def _create(self, shape: int, position: Any, orientation: Any) -> int:
        body = self._client.createMultiBody(0.0, shape, basePosition=position, baseOrientation=orientation)
        with undone(lambda: self._client.removeBody(body)):
            self._client.changeDynamics(body, -1, lateralFriction=1.0, restitution=1.0)
        return int(body)


def whole_vertices(heightmap: HeightMap, time: float) -> FloatArray:
    """Return all vertices of a height map at ``time`` [s], row by row (V, 3) [m]."""
    geometry = heightmap.geometry
    rows, columns = np.divmod(np.arange(geometry.size), geometry.columns)
    indices: IntArray = np.arange(geometry.size).reshape(geometry.rows, geometry.columns)
    vertices = np.empty((geometry.size, 3))
    vertices[:, :2] = geometry.to_world(rows, columns)
    vertices[:, 2] = heightmap.sample(indices, time).heights.ravel()
    return vertices
