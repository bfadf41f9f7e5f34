"""The meshes on which each of the report's nearest-vertex searches is valid (Chapter 3)."""

from __future__ import annotations

from typing import get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import ANYWHERE, SearchMethod
from smartmesh_ros.terrain.mesh_shape import MeshShape
from smartmesh_ros.terrain.trimesh import TriangleMesh


def require_search(method: SearchMethod, mesh: TriangleMesh) -> None:
    """Raise `InputError`, which names valid methods, if ``method`` is not valid on a general mesh, or the mesh has
    several parts.

    A method is valid if it finds the nearest vertex. On height maps, which are uniform grids, every method is.
    """
    if mesh.parts > 1:
        raise InputError(
            "mesh_parts",
            f"the mesh has {mesh.parts} parts that share no vertices. The patch of a body covers one part only, so "
            "bodies would fall through the others; merge vertices at the same place, as STL files need, or sample the "
            "mesh into a height map",
        )
    if method not in ANYWHERE:
        require_search_on(method, mesh.shape)


def require_search_on(method: SearchMethod, shape: MeshShape) -> None:
    """Raise `InputError`, which names valid methods, if ``method`` is not valid on a mesh of this ``shape``."""
    reason = _why_invalid(method, shape)
    if reason:
        valid = ", ".join(other for other in get_args(SearchMethod) if not _why_invalid(other, shape))
        raise InputError(
            "search_method", f"search.method {method!r} cannot be used on this mesh: {reason}; use {valid}"
        )


def _why_invalid(method: SearchMethod, shape: MeshShape) -> str:
    """Return the reason why a method is not valid, "" if it is."""
    if method == "best_first":
        return shape.reason
    if method == "grid_traversal" and shape.grid is None:
        return shape.reason or "its vertices are not an evenly spaced grid"
    return ""
