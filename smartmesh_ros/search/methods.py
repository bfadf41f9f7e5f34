"""The report's nearest-vertex searches (Chapter 3) by name, and on which meshes each may be used."""

from __future__ import annotations

from typing import Literal, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.mesh_shape import MeshShape
from smartmesh_ros.terrain.trimesh import TriangleMesh

SearchMethod = Literal["brute_force", "ray_cast", "best_first", "grid_traversal"]
# Methods that assume nothing about the mesh.
ANYWHERE = ("brute_force", "ray_cast")


def require_search(method: SearchMethod, mesh: TriangleMesh) -> None:
    """Raises `InputError` where ``method`` would not find the nearest vertex of a general mesh, naming what would.

    Height maps are uniform grids, on which every method is right.
    """
    if method not in ANYWHERE:
        require_search_on(method, mesh.shape)


def require_search_on(method: SearchMethod, shape: MeshShape) -> None:
    """The same for a shape that a mesh has or would have."""
    reason = _objection(method, shape)
    if reason:
        working = ", ".join(other for other in get_args(SearchMethod) if not _objection(other, shape))
        raise InputError(
            "search_method", f"search.method {method!r} cannot be used on this mesh: {reason}; use {working}"
        )


def _objection(method: SearchMethod, shape: MeshShape) -> str:
    if method == "best_first":
        return shape.reason
    if method == "grid_traversal" and shape.grid is None:
        return shape.reason or "its vertices are not an evenly spaced grid"
    return ""
