"""Settings of patches."""

import math
from dataclasses import dataclass
from typing import Literal, TypeGuard, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.report.collect import CollectMethod
from smartmesh_ros.patches.report.extent import MOST_GRID_RINGS
from smartmesh_ros.search.methods import SearchMethod


@dataclass(frozen=True, kw_only=True)
class SelectionConfig:
    """Fixed settings of the choice of supports; users tune `PatchConfig` instead.

    ``hysteresis``: a plane replaces a field only if its deviation is below this share of the tolerance. Lower values
    change colliders less often; each change loses the collider's contacts. ``leave`` [m]: a body keeps its collider
    until the ground is this far out of its reach, because changes lose contacts. ``most_cells``: largest number of
    cells of a field. A larger rectangle gets a coarser stride, because replacing a filtered field of 32 x 32 cells
    takes a millisecond. ``most_samples``: largest side of the window searched for contact candidates; a larger window
    is read with a stride. ``fastest`` [m/s]: clamp on the speed that sizes windows, because a teleported body has no
    real speed. ``collider_slack``: a collider stays where it is while its error is below this share of the tolerance.
    ``slack``: a body may exceed its predicted motion by this share of its radius before its patch is refreshed.
    """

    hysteresis: float = 0.5
    leave: float = 0.002
    most_cells: int = 1024
    most_samples: int = 128
    fastest: float = 50.0
    collider_slack: float = 0.5
    slack: float = 0.2


SELECTION = SelectionConfig()

# Colliders made of triangles, which PyBullet cannot change.
MeshKind = Literal["trimesh", "hull", "prisms"]
# One collider of the whole terrain.
WholeKind = Literal["whole_trimesh", "whole_heightfield"]
# The collider of one patch; "whole" = no collider of its own, because the body stands on one of the whole terrain.
ColliderKind = Literal["heightfield", "plane", MeshKind, "whole"]
PatchKind = Literal["auto", "plane", "heightfield", MeshKind, WholeKind]
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

    ``search``, ``collect``: methods of the report; used by patches of fixed extent only. ``kind``: the collider. *auto*
    selects the ground that each body can touch: nothing, a plane, or the smallest rectangle of samples within the
    tolerance. *heightfield* always gives a body near the ground a rectangle, *plane* accepts a plane of any deviation.
    The last two kinds are the report's Simple-Mesh, one collider of the whole terrain. ``rings``: number of samples on
    each side of the nearest vertex (the report's collider-size), for which *auto* and *plane* use a heightfield; 0 =
    the ground that the body can touch. ``tolerance`` [m]: largest distance of a patch from the main mesh. ``rate``
    [Hz]: refreshes of the patches per second; 0 = in every step. New maps add refreshes, up to twice this rate, unless
    the world runs behind real time. ``edge_filter``: suppress ghost collisions at the inner edges of patches; for
    balls only where the ground is at rest. ``carry_velocity``: colliders move with the ground's velocity, so that
    contacts see it.
    """

    search: SearchMethod = "auto"
    collect: CollectMethod = "cached"
    kind: PatchKind = "auto"
    rings: int = 0
    tolerance: float = 0.0005
    rate: float = 60.0
    edge_filter: bool = True
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
        if not self.tolerance > 0.0:
            raise InputError("parameter", f"patch tolerance is {self.tolerance} m; it must be greater than zero")

    @property
    def chooses(self) -> bool:
        """Return True if each body gets the ground that it can touch instead of a patch of fixed extent."""
        return self.kind in ("auto", "plane", "heightfield") and self.rings == 0

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
