"""States of many bodies as arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST, FASTEST_SPIN, MASSES, SIZES
from smartmesh_ros.ground.shapes import DIMENSIONS, Shape, ShapeKind, shape_of
from smartmesh_ros.terrain.deck import QUATERNION_SLACK
from smartmesh_ros.terrain.grid import FloatArray, IntArray


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


Right = NDArray[np.bool_]  # (n,)


def _within(vectors: FloatArray, most: float) -> Right:
    return np.asarray((np.abs(vectors) <= most).all(axis=1))


def _between(numbers: FloatArray, limits: tuple[float, float]) -> Right:
    return (limits[0] <= numbers) & (numbers <= limits[1])


def _numbers_of_dimensions(states: StateTable) -> IntArray:
    """Return how many dimensions the shapes have (n,), 0 = there is no such kind."""
    return np.where(states.kinds < len(DIMENSIONS), DIMENSIONS.take(states.kinds, mode="clip"), 0)


def _have_sizes(states: StateTable) -> Right:
    unused = np.arange(states.dimensions.shape[1]) >= _numbers_of_dimensions(states)[:, None]
    return np.asarray((unused | _between(states.dimensions, SIZES)).all(axis=1))


# Checks of bodies in their order: reasons and words of the refusals, and which bodies are right.
CHECKS: tuple[tuple[str, str, Callable[[StateTable], Any]], ...] = (
    ("non_finite", "a state that is not finite", lambda it: np.isfinite(it.numbers).all(axis=1)),
    ("quaternion", "an orientation whose length is not 1",
     lambda it: np.abs(np.linalg.norm(it.numbers[:, 3:7], axis=1) - 1.0) <= QUATERNION_SLACK),
    ("geometry", f"a position farther than {FARTHEST_BODY:g} m", lambda it: _within(it.numbers[:, :3], FARTHEST_BODY)),
    ("geometry", f"a velocity above {FASTEST:g} m/s", lambda it: _within(it.numbers[:, 7:10], FASTEST)),
    ("geometry", f"an angular velocity above {FASTEST_SPIN:g} rad/s",
     lambda it: _within(it.numbers[:, 10:], FASTEST_SPIN)),
    ("shape", "a shape of no known kind", lambda it: _numbers_of_dimensions(it) > 0),
    ("geometry", f"a shape not within {SIZES[0]:g} to {SIZES[1]:g} m", _have_sizes),
    ("geometry", f"a shape farther than {SIZES[1]:g} m from its centre of mass",
     lambda it: _within(it.centres, SIZES[1])),
    ("geometry", f"a radius not within {SIZES[0]:g} to {SIZES[1]:g} m", lambda it: _between(it.radii, SIZES)),
    ("geometry", f"a mass not within {MASSES[0]:g} to {MASSES[1]:g} kg", lambda it: _between(it.masses, MASSES)),
)  # fmt: skip


def require_valid(states: StateTable) -> None:
    """Raise `InputError`, naming the first body, if a state, shape or mass is impossible."""
    with np.errstate(over="ignore", invalid="ignore"):
        wrong = ~np.array([are_right(states) for _, _, are_right in CHECKS])
    if wrong.any():
        row = int(wrong.any(axis=0).argmax())
        reason, what, _ = CHECKS[int(wrong[:, row].argmax())]
        raise InputError(reason, f"body {states.names[row]!r} has {what}")
