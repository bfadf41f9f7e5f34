"""Settings of patches."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.collect import CollectMethod
from smartmesh_ros.patches.extent import MOST_RINGS
from smartmesh_ros.search.methods import SearchMethod

# The collider of one patch; "whole" = none of its own, the body stands on a collider of the whole terrain.
ColliderKind = Literal["heightfield", "plane", "trimesh", "hull", "prisms", "whole"]
PatchKind = Literal["auto", "plane", "heightfield", "trimesh", "hull", "prisms", "whole_trimesh", "whole_heightfield"]


@dataclass(frozen=True, kw_only=True)
class PatchConfig:
    """How patches are made.

    ``search``, ``collect``: the report's methods. ``kind``: the collider; *auto* chooses for each body none, a plane or
    the heightfield with the fewest samples, whichever is cheapest within the tolerance; *plane* does without the
    tolerance; the last two are the report's Simple-Mesh, one collider of the whole terrain. ``rings``: samples on each
    side of the nearest vertex (the report's collider-size); 0 = from the body's size and speed, above 0 there is no
    choice to make and *auto* is a heightfield. ``tolerance`` [m]: how far a patch may lie from the main mesh.
    ``rate`` [Hz]: patches are brought up to date so often, and as soon as maps come, up to twice as often unless the
    world is hurried; 0 = in every step.
    ``edge_filter``: no ghost collisions at the inner edges of patches; balls need none. ``carry_velocity``: patches
    carry the ground's velocity into the contact.
    """

    search: SearchMethod = "grid_traversal"
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
        if not 0 <= self.rings <= MOST_RINGS:
            raise InputError("parameter", f"patch rings is {self.rings}; it must be 0 (from the body) to {MOST_RINGS}")
        if not (math.isfinite(self.rate) and self.rate >= 0.0):
            raise InputError("parameter", f"patch rate is {self.rate} Hz; it must be zero or more")
        if not self.tolerance > 0.0:
            raise InputError("parameter", f"patch tolerance is {self.tolerance} m; it must be greater than zero")

    @property
    def chooses(self) -> bool:
        """Whether each body gets as much ground as it needs."""
        return self.kind == "plane" or (self.kind == "auto" and self.rings == 0)

    @property
    def plane_tolerance(self) -> float:
        """How far a plane may lie from the main mesh [m]."""
        return math.inf if self.kind == "plane" else self.tolerance

    @property
    def grid_kind(self) -> ColliderKind:
        """Collider of the patches of height maps."""
        if self.kind in ("trimesh", "hull", "prisms"):
            return self.kind
        return "whole" if self.kind in ("whole_trimesh", "whole_heightfield") else "heightfield"

    @property
    def mesh_kind(self) -> ColliderKind:
        """Collider of the patches of general meshes, which are no heightfields."""
        return "trimesh" if self.grid_kind == "heightfield" else self.grid_kind
