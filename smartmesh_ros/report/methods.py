"""Which settings of patches a main mesh allows."""

from __future__ import annotations

from typing import get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import ANYWHERE, PatchConfig, SearchMethod, WholeKind, is_whole
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.mesh_shape import MeshShape
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Largest arrays that PyBullet accepts.
MOST_VERTICES = 131_072
MOST_INDICES = 524_288


def require_usable(config: PatchConfig, mesh: MainMesh, *, exact: bool) -> None:
    """Raise `InputError` if ``mesh`` does not allow the patch settings ``config``; the message names settings that it
    allows. ``exact``: contacts come from the map, which every mesh allows; the search for patches that are shown may
    not work on it."""
    if exact:
        if isinstance(mesh, TriangleMesh) and config.search not in ANYWHERE:
            require_search_on(config.search, mesh.shape)
        return
    if isinstance(mesh, TriangleMesh):
        require_search(config.search, mesh)
    if is_whole(config.kind):
        require_whole(config.kind, mesh)


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
