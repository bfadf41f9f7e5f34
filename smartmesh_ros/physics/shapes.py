"""Shapes of simulated bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.physics.limits import SIZES, require_between
from smartmesh_ros.terrain.grid import FloatArray


class _Shape:
    """Checks that every dimension is a possible number of metres."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]  # every shape is a dataclass
            what = f"{field.name} of the {type(self).__name__.lower()}"
            require_between(what, getattr(self, field.name), SIZES, "m")


@dataclass(frozen=True)
class Sphere(_Shape):
    """A sphere."""

    radius: float

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere around the centre that holds the shape [m]."""
        return self.radius

    @property
    def inner_radius(self) -> float:
        """Radius of the largest sphere around the centre inside the shape [m]."""
        return self.radius

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_SPHERE, "radius": self.radius}


@dataclass(frozen=True)
class Box(_Shape):
    """A box of edge lengths x, y, z."""

    x: float
    y: float
    z: float

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere around the centre that holds the shape [m]."""
        return 0.5 * math.hypot(self.x, self.y, self.z)

    @property
    def inner_radius(self) -> float:
        """Radius of the largest sphere around the centre inside the shape [m]."""
        return 0.5 * min(self.x, self.y, self.z)

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_BOX, "halfExtents": [0.5 * self.x, 0.5 * self.y, 0.5 * self.z]}


@dataclass(frozen=True)
class Cylinder(_Shape):
    """A cylinder along z."""

    radius: float
    height: float

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere around the centre that holds the shape [m]."""
        return math.hypot(self.radius, 0.5 * self.height)

    @property
    def inner_radius(self) -> float:
        """Radius of the largest sphere around the centre inside the shape [m]."""
        return min(self.radius, 0.5 * self.height)

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_CYLINDER, "radius": self.radius, "height": self.height}


@dataclass(frozen=True)
class Capsule(_Shape):
    """A capsule along z; ``height`` is the distance between the centres of its two half spheres."""

    radius: float
    height: float

    @property
    def bounding_radius(self) -> float:
        """Radius of the sphere around the centre that holds the shape [m]."""
        return self.radius + 0.5 * self.height

    @property
    def inner_radius(self) -> float:
        """Radius of the largest sphere around the centre inside the shape [m]."""
        return self.radius

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_CAPSULE, "radius": self.radius, "height": self.height}


Shape = Sphere | Box | Cylinder | Capsule


class SolidKind(IntEnum):
    """Kinds of shapes as numbers, as messages have them."""

    NONE = 0
    BOX = 1
    SPHERE = 2
    CYLINDER = 3
    CAPSULE = 4


_KINDS: dict[SolidKind, type[Shape]] = {
    SolidKind.BOX: Box,
    SolidKind.SPHERE: Sphere,
    SolidKind.CYLINDER: Cylinder,
    SolidKind.CAPSULE: Capsule,
}
# How many dimensions the shapes of each kind have.
DIMENSIONS = np.array([len(fields(_KINDS[kind])) if kind in _KINDS else 0 for kind in SolidKind])


def kind_of(shape: Shape) -> tuple[SolidKind, list[float]]:
    """The kind of a shape and its dimensions in the order of its class, zeros after them (3,) [m]."""
    [kind] = [kind for kind, made in _KINDS.items() if isinstance(shape, made)]
    dimensions = [float(value) for value in astuple(shape)]
    return kind, dimensions + [0.0] * (3 - len(dimensions))


def shape_of(kind: SolidKind, dimensions: Sequence[float]) -> Shape:
    """The shape that `kind_of` tells."""
    return _KINDS[kind](*dimensions[: int(DIMENSIONS[kind])])


def support(shape: Shape, orientation: tuple[float, float, float, float], normal: FloatArray) -> float:
    """How far a shape in an ``orientation`` (x, y, z, w) reaches from its middle against a unit ``normal`` (3,) [m]."""
    if isinstance(shape, Sphere):
        return shape.radius
    x, y, z, w = orientation
    across = np.array([  # the normal along the shape's own axes
        normal @ (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
        normal @ (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
        normal @ (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
    ])  # fmt: skip
    if isinstance(shape, Box):
        return float(0.5 * np.abs(across) @ (shape.x, shape.y, shape.z))
    if isinstance(shape, Cylinder):
        return float(shape.radius * math.hypot(across[0], across[1]) + 0.5 * shape.height * abs(across[2]))
    return float(shape.radius + 0.5 * shape.height * abs(across[2]))
