"""Settings of patches, and which of them a main mesh allows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeGuard, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.mesh_shape import MeshShape
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh

# The report's nearest-vertex searches, and those of them that are valid on every mesh. *auto* is grid traversal on
# evenly spaced grids, and brute force elsewhere.
SearchMethod = Literal["brute_force", "ray_cast", "best_first", "grid_traversal", "auto"]
ANYWHERE = ("brute_force", "ray_cast", "auto")
# The report's ways to collect the vertices of a patch.
CollectMethod = Literal["queue_bfs", "union_bfs", "cached"]
# Rings of the report's largest collider: 9 x 9 samples.
MOST_GRID_RINGS = 4
# Colliders made of triangles, which PyBullet cannot change.
MeshKind = Literal["trimesh", "hull", "prisms"]
# One collider of the whole terrain.
WholeKind = Literal["whole_trimesh", "whole_heightfield"]
# The collider of one patch; "whole" = no collider of its own, because the body stands on one of the whole terrain.
ColliderKind = Literal["heightfield", MeshKind, "whole"]
PatchKind = Literal["heightfield", MeshKind, WholeKind]
# Rings of the largest patch: 65 x 65 samples, which PyBullet replaces in about two milliseconds.
MOST_RINGS = 32
MESH_KINDS, WHOLE_KINDS = get_args(MeshKind), get_args(WholeKind)


def is_mesh(kind: str) -> TypeGuard[MeshKind]:
    """Return True if a kind's colliders are made of triangles."""
    return kind in MESH_KINDS


def is_whole(kind: str) -> TypeGuard[WholeKind]:
    """Return True if a kind has one collider of the whole terrain."""
    return kind in WHOLE_KINDS


@dataclass(frozen=True, kw_only=True)
class ReportConfig:
    """How the report's colliders are made.

    ``kind``: a *heightfield* of the samples around each body; the report's *trimesh*, *hull* and *prisms*; and its
    Simple-Mesh, one collider of the whole terrain. ``search``, ``collect``: the report's methods. ``rings``: number of
    samples on each side of the nearest vertex (the report's collider-size); 0 = as many as the body and its motion
    need. ``rate`` [Hz]: refreshes of the colliders per second; 0 = in every step. New maps add refreshes.
    ``carry_velocity``: colliders have the ground's velocity. ``guard``: bodies below the ground are put back onto it.
    """

    search: SearchMethod = "auto"
    collect: CollectMethod = "cached"
    kind: PatchKind = "heightfield"
    rings: int = 0
    rate: float = 60.0
    carry_velocity: bool = True
    guard: bool = True

    def __post_init__(self) -> None:
        for name, kinds in (("search", SearchMethod), ("collect", CollectMethod), ("kind", PatchKind)):
            value = getattr(self, name)
            if value not in get_args(kinds):
                raise InputError("parameter", f"patch {name} {value!r} is unknown; choose {', '.join(get_args(kinds))}")
        if not 0 <= self.rings <= MOST_GRID_RINGS:
            raise InputError(
                "parameter", f"patch rings is {self.rings}; it must be 0 (from the body) to {MOST_GRID_RINGS}"
            )
        if not (math.isfinite(self.rate) and self.rate >= 0.0):
            raise InputError("parameter", f"patch rate is {self.rate} Hz; it must be zero or more")

    @property
    def most_rings(self) -> int:
        """Rings of the largest patch around a body; larger bodies get a coarser stride."""
        return MOST_RINGS if self.kind == "heightfield" else MOST_GRID_RINGS

    @property
    def grid_kind(self) -> ColliderKind:
        """Collider kind of patches on height maps."""
        if is_mesh(self.kind):
            return self.kind
        return "whole" if is_whole(self.kind) else "heightfield"

    @property
    def mesh_kind(self) -> ColliderKind:
        """Collider kind of patches on general meshes, which cannot be heightfields."""
        return "trimesh" if self.grid_kind == "heightfield" else self.grid_kind


# Largest arrays that PyBullet accepts.
MOST_VERTICES = 131_072
MOST_INDICES = 524_288


def require_usable(config: ReportConfig, mesh: MainMesh) -> None:
    """Raise `InputError` if ``mesh`` does not allow the settings; the message names settings that it allows."""
    if isinstance(mesh, TriangleMesh):
        require_search(config.search, mesh)
    if is_whole(config.kind):
        require_whole(config.kind, mesh)


def require_whole(kind: WholeKind, mesh: MainMesh) -> None:
    """Raise `InputError` if PyBullet cannot make one collider of a whole mesh."""
    if kind == "whole_heightfield" and not isinstance(mesh, HeightMap):
        raise InputError("parameter", "a general mesh is no heightfield; use the kind 'whole_trimesh' or 'trimesh'")
    if kind == "whole_trimesh":
        indices = 6 * mesh.size if isinstance(mesh, HeightMap) else mesh.triangles.size
        if mesh.size > MOST_VERTICES or indices > MOST_INDICES:
            raise InputError(
                "size",
                f"PyBullet takes no trimesh of {mesh.size} vertices (at most about {MOST_INDICES // 6} of a grid); use "
                "the kind 'whole_heightfield'",
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
        raise InputError("search_method", f"the search {method!r} cannot be used on this mesh: {reason}; use {valid}")


def _why_invalid(method: SearchMethod, shape: MeshShape) -> str:
    """Return the reason why a method is not valid, "" if it is."""
    if method == "best_first":
        return shape.reason
    if method == "grid_traversal" and shape.grid is None:
        return shape.reason or "its vertices are not an evenly spaced grid"
    return ""
