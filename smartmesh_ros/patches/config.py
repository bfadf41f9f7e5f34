"""Settings of patches."""

from dataclasses import dataclass
from typing import Literal, get_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.extent import MOST_RINGS

PatchKind = Literal["auto", "plane", "heightfield", "trimesh", "hull", "prisms"]


@dataclass(frozen=True, kw_only=True)
class PatchConfig:
    """How patches are made.

    ``kind``: the collider. ``rings``: samples on each side of the nearest vertex (the report's collider-size);
    0 = from the body's size and speed. ``tolerance`` [m]: how far a patch may lie from the main mesh.
    ``edge_filter``: no ghost collisions at the inner edges of patches. ``carry_velocity``: patches carry the ground's
    velocity into the contact.
    """

    kind: PatchKind = "auto"
    rings: int = 0
    tolerance: float = 0.002
    edge_filter: bool = True
    carry_velocity: bool = True

    def __post_init__(self) -> None:
        if self.kind not in get_args(PatchKind):
            raise InputError(
                "parameter", f"patch kind {self.kind!r} is unknown; choose {', '.join(get_args(PatchKind))}"
            )
        if not 0 <= self.rings <= MOST_RINGS:
            raise InputError("parameter", f"patch rings is {self.rings}; it must be 0 (from the body) to {MOST_RINGS}")
        if not self.tolerance > 0.0:
            raise InputError("parameter", f"patch tolerance is {self.tolerance} m; it must be greater than zero")
