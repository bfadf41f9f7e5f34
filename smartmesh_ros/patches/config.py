"""Settings of patches."""

import math
from dataclasses import dataclass
from typing import Literal, TypeGuard, get_args

from smartmesh_ros.errors import InputError

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
PatchKind = Literal["auto", "heightfield", MeshKind, WholeKind]
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
class PatchConfig:
    """How patches are made.

    ``kind``: *auto* works out contacts from the map itself; its patches are only shown. Where that is impossible (see
    `Ground.no_proxies`), it is *heightfield*. The other kinds are colliders of PyBullet's own: a *heightfield* of the
    samples around each body; the report's *trimesh*, *hull* and *prisms*; and its Simple-Mesh, one collider of the
    whole terrain. ``search``, ``collect``: the report's methods for these and for patches that are shown. ``rings``:
    number of samples on each side of the nearest vertex (the report's collider-size); 0 = as many as the body and its
    motion need. ``rate`` [Hz]: refreshes of the patches per second; 0 = in every step. New maps add refreshes, up to
    twice this rate, unless the world runs behind real time. ``carry_velocity``: contacts see the ground's velocity.
    """

    search: SearchMethod = "auto"
    collect: CollectMethod = "cached"
    kind: PatchKind = "auto"
    rings: int = 0
    rate: float = 60.0
    carry_velocity: bool = True

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
        return MOST_RINGS if self.kind in ("auto", "heightfield") else MOST_GRID_RINGS

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
