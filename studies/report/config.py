"""Settings of the report's colliders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# The report's searches on a general mesh. On height maps the nearest sample is found by grid traversal.
SearchMethod = Literal["brute_force", "best_first"]
# The report's ways to collect the vertices of a patch of a general mesh.
CollectMethod = Literal["union_bfs", "cached"]
# Colliders of patches, of which PyBullet cannot change those made of triangles; and one collider of a whole height map.
PatchKind = Literal["heightfield", "trimesh", "hull", "prisms", "whole_trimesh", "whole_heightfield"]


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

    @property
    def whole(self) -> bool:
        """True if one collider is that of the whole terrain."""
        return self.kind.startswith("whole")
