"""Settings of the report's colliders, and which main meshes allow them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeGuard, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh

# The report's searches on a general mesh. On height maps the nearest sample is found by grid traversal.
SearchMethod = Literal["brute_force", "best_first"]
# The report's ways to collect the vertices of a patch of a general mesh.
CollectMethod = Literal["union_bfs", "cached"]
# Rings of the report's largest collider: 9 x 9 samples.
MOST_GRID_RINGS = 4
# Colliders made of triangles, which PyBullet cannot change.
MeshKind = Literal["trimesh", "hull", "prisms"]
# One collider of the whole terrain.
WholeKind = Literal["whole_trimesh", "whole_heightfield"]
PatchKind = Literal["heightfield", MeshKind, WholeKind]
# Rings of the largest patch: 65 x 65 samples, which PyBullet replaces in about two milliseconds.
MOST_RINGS = 32


def is_whole(kind: str) -> TypeGuard[WholeKind]:
    """Return True if a kind has one collider of the whole terrain."""
    return kind in get_args(WholeKind)


@dataclass(frozen=True, kw_only=True)
class ReportConfig:
    """How the report's colliders are made.

    ``kind``: a *heightfield* of the samples around each body; the report's *trimesh*, *hull* and *prisms*; and its
    Simple-Mesh, one collider of the whole terrain. ``search``, ``collect``: the report's methods on a general mesh.
    *best_first* is right on Delaunay triangulations of convex regions. ``rings``: number of samples on each side of the
    nearest vertex (the report's collider-size); 0 = as many as the body and its motion need. ``rate`` [Hz]: refreshes
    of the colliders per second; 0 = in every step. New maps add refreshes. ``carry_velocity``: colliders have the
    ground's velocity. ``guard``: bodies below the ground are put back onto it.
    """

    search: SearchMethod = "best_first"
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


# Largest arrays that PyBullet accepts.
MOST_VERTICES = 131_072
MOST_INDICES = 524_288


def require_whole(kind: WholeKind, mesh: MainMesh) -> None:
    """Raise `InputError`, which names a kind that is possible, if PyBullet cannot make one collider of a whole mesh."""
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
