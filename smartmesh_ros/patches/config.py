"""Settings of patches."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.report.collect import CollectMethod
from smartmesh_ros.patches.report.extent import MOST_RINGS
from smartmesh_ros.search.methods import SearchMethod


@dataclass(frozen=True, kw_only=True)
class SelectionConfig:
    """How supports are chosen, beyond what users tune.

    ``hysteresis``: share of the tolerance within which a plane takes the place of a field, so that none changes back
    and forth: changing a collider loses its contacts. ``leave`` [m]: a body loses its collider so far above the ground,
    beyond what it can reach, for the same reason. ``most_cells``: of a field; larger ones get a coarser stride,
    because replacing a filtered one of 32 x 32 takes a millisecond. ``most_samples``: of the window that is
    looked at, on a side; for larger bodies samples are left out. ``fastest`` [m/s]: faster bodies get no larger
    windows; a teleport is not a speed. ``carried``: a collider is left alone while it lies within this share of the
    tolerance of where it should be. ``slack``: share of its radius that a body may go beyond what it was taken to.
    """

    hysteresis: float = 0.5
    leave: float = 0.002
    most_cells: int = 1024
    most_samples: int = 128
    fastest: float = 50.0
    carried: float = 0.5
    slack: float = 0.2


SELECTION = SelectionConfig()

# The collider of one patch; "whole" = none of its own, the body stands on a collider of the whole terrain.
ColliderKind = Literal["heightfield", "plane", "trimesh", "hull", "prisms", "whole"]
PatchKind = Literal["auto", "plane", "heightfield", "trimesh", "hull", "prisms", "whole_trimesh", "whole_heightfield"]


@dataclass(frozen=True, kw_only=True)
class PatchConfig:
    """How patches are made.

    ``search``, ``collect``: the report's methods, for patches of fixed extent. ``kind``: the collider; *auto* gives
    each body what it can touch: nothing, a plane, or the smallest rectangle of samples within the tolerance;
    *heightfield* does so without planes and without nothing, *plane* without the tolerance; the last two are the
    report's Simple-Mesh, one collider of the whole terrain. ``rings``: samples on each side of the nearest vertex (the
    report's collider-size), for *auto* and *plane* a heightfield; 0 = what the body can touch. ``tolerance`` [m]: how
    far a patch may lie from the main mesh. ``rate`` [Hz]: patches are brought up to date so often, and as soon as maps
    come, up to twice as often unless the world is behind real time; 0 = in every step.
    ``edge_filter``: no ghost collisions at the inner edges of patches; for balls only where the ground is at rest.
    ``carry_velocity``: patches carry the ground's velocity into the contact.
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
        """Whether each body gets what it can touch, and no patch of fixed extent."""
        return self.kind in ("auto", "plane", "heightfield") and self.rings == 0

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
