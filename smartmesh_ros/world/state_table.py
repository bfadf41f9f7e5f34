"""States of many bodies as arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST, FASTEST_SPIN, MASSES, SIZES
from smartmesh_ros.ground.shapes import DIMENSIONS, Shape, ShapeKind, shape_of
from smartmesh_ros.terrain.deck import QUATERNION_SLACK
from smartmesh_ros.terrain.grid import FloatArray


class StateTable(NamedTuple):
    """n bodies: ``names``; ``numbers`` (n, 13) with columns position [m], orientation (x, y, z, w), velocity [m/s] and
    angular velocity [rad/s]; bounding ``radii`` (n,) [m]; ``kinds`` (n,) of `ShapeKind` with ``dimensions`` (n, 3) [m];
    ``centres`` (n, 3), the middles of boxes relative to the centre of mass [m]; ``masses`` (n,) [kg]."""

    names: list[str]
    numbers: FloatArray
    radii: FloatArray
    kinds: NDArray[np.uint8]
    dimensions: FloatArray
    centres: FloatArray
    masses: FloatArray

    def shape(self, row: int) -> Shape:
        """The shape of a body."""
        dimensions, centre = self.dimensions[row].tolist(), self.centres[row].tolist()
        return shape_of(ShapeKind(int(self.kinds[row])), dimensions, centre)

    @property
    def constant(self) -> tuple[NDArray[Any], ...]:
        """What does not change while bodies move, besides their names."""
        return self.kinds, self.dimensions, self.centres, self.masses

    def same_body(self, row: int, other: StateTable, other_row: int) -> bool:
        """Return True if two bodies have the same shape and mass."""
        pairs = zip(self.constant, other.constant, strict=True)
        return all(np.array_equal(mine[row], its[other_row]) for mine, its in pairs)

    def same_bodies(self, other: StateTable) -> bool:
        """Return True if both tables hold the same bodies, whatever their states."""
        return self.names == other.names and all(map(np.array_equal, self.constant, other.constant))


# Reasons and words of the refusals, in the order of the checks.
INVALID = (
    ("non_finite", "a state that is not finite"),
    ("quaternion", "an orientation whose length is not 1"),
    ("geometry", f"a position farther than {FARTHEST_BODY:g} m"),
    ("geometry", f"a velocity above {FASTEST:g} m/s"),
    ("geometry", f"an angular velocity above {FASTEST_SPIN:g} rad/s"),
    ("shape", "a shape of no known kind"),
    ("geometry", f"a shape not within {SIZES[0]:g} to {SIZES[1]:g} m"),
    ("geometry", f"a shape farther than {SIZES[1]:g} m from its centre of mass"),
    ("geometry", f"a radius not within {SIZES[0]:g} to {SIZES[1]:g} m"),
    ("geometry", f"a mass not within {MASSES[0]:g} to {MASSES[1]:g} kg"),
)
# The dimensions of each kind, and limits in the order of `BodyLimits` in core/python/bindings_rows.cpp.
LIMITS = (DIMENSIONS, np.array([FARTHEST_BODY, FASTEST, FASTEST_SPIN, QUATERNION_SLACK, *SIZES, *MASSES]))


def require_valid(states: StateTable) -> None:
    """Raise `InputError`, naming the first body, if a state, shape or mass is impossible."""
    _, *arrays = states
    if (found := CORE.first_fault(*arrays, LIMITS)) is not None:
        row, fault = found
        reason, wrong = INVALID[fault]
        raise InputError(reason, f"body {states.names[row]!r} has {wrong}")
