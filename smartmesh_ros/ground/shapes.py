"""Shapes of simulated bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import SIZES, require_between
from smartmesh_ros.ground.state import Vector

CENTRED: Vector = (0.0, 0.0, 0.0)


class _Shape:
    """Checks that every dimension is within the limits [m]."""

    centre: Vector = CENTRED

    def __post_init__(self) -> None:
        for name, value in self.dimensions.items():
            require_between(f"{name} of the {type(self).__name__.lower()}", value, SIZES, "m")

    @property
    def dimensions(self) -> dict[str, float]:
        """The dimensions by name [m]."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]  # every shape is a dataclass
        return {name: getattr(self, name) for name in names if name != "centre"}


@dataclass(frozen=True)
class Sphere(_Shape):
    """A sphere."""

    radius: float

    @property
    def bounding_radius(self) -> float:
        """Bounding radius about the centre [m]."""
        return self.radius

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_SPHERE, "radius": self.radius}


@dataclass(frozen=True)
class Box(_Shape):
    """A box of edge lengths x, y, z; ``centre`` is the position of its middle relative to the centre of mass [m]."""

    x: float
    y: float
    z: float
    centre: Vector = field(default=CENTRED, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(abs(value) <= SIZES[1] for value in self.centre):
            raise InputError("geometry", f"centre of the box is {self.centre} m; at most {SIZES[1]:g} is possible")
        object.__setattr__(self, "centre", tuple(self.centre))

    @property
    def bounding_radius(self) -> float:
        """Bounding radius about the centre of mass [m]."""
        return 0.5 * math.hypot(self.x, self.y, self.z) + math.hypot(*self.centre)

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        half = [0.5 * self.x, 0.5 * self.y, 0.5 * self.z]
        return {"shapeType": pb.GEOM_BOX, "halfExtents": half, "collisionFramePosition": self.centre}


@dataclass(frozen=True)
class Cylinder(_Shape):
    """A cylinder along z."""

    radius: float
    height: float

    @property
    def bounding_radius(self) -> float:
        """Bounding radius about the centre [m]."""
        return math.hypot(self.radius, 0.5 * self.height)

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
        """Bounding radius about the centre [m]."""
        return self.radius + 0.5 * self.height

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": pb.GEOM_CAPSULE, "radius": self.radius, "height": self.height}


Shape = Sphere | Box | Cylinder | Capsule


class SolidKind(IntEnum):
    """Kinds of shapes as numbers, as used in messages."""

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
# Number of dimensions of the shapes of each kind.
DIMENSIONS = np.array([0, 3, 1, 2, 2])


class Form(NamedTuple):
    """A shape as numbers: its kind; its dimensions in the order of its class, padded with zeros (3,) [m]; the position
    of its middle relative to the centre of mass (3,) [m], zero except for boxes."""

    kind: SolidKind
    dimensions: Sequence[float]
    centre: Sequence[float] = CENTRED


def form_of(shape: Shape) -> Form:
    """Return a shape as numbers."""
    [kind] = [kind for kind, made in _KINDS.items() if isinstance(shape, made)]
    dimensions = [float(value) for value in shape.dimensions.values()]
    return Form(kind, dimensions + [0.0] * (3 - len(dimensions)), shape.centre)


def shape_of(form: Form) -> Shape:
    """Return the shape of a form; the inverse of `form_of`."""
    made, used = _KINDS[form.kind], form.dimensions[: int(DIMENSIONS[form.kind])]
    if made is Box:
        x, y, z = form.centre
        return Box(*used, centre=(x, y, z))
    return made(*used)
