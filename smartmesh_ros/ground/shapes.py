"""Shapes of simulated bodies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from typing import Any, ClassVar, get_args

import numpy as np
import pybullet as pb

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.ground.limits import SIZES, require_between
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.terrain.grid import FloatArray

CENTRED: Vector = (0.0, 0.0, 0.0)


class ShapeKind(IntEnum):
    """Kind of a shape: BOX; BALL; CYLINDER, about z; CAPSULE, along z; HULL, the convex hull of vertices; COMPOUND,
    several of these. Numbered as in smartmesh_msgs/TrackedBody and BodyDescription."""

    NONE = 0
    BOX = 1
    BALL = 2
    CYLINDER = 3
    CAPSULE = 6
    HULL = 8
    COMPOUND = 9


class _Shape(ABC):
    """Checks that every dimension is within the limits [m]."""

    kind: ClassVar[ShapeKind]
    geometry: ClassVar[int]  # in PyBullet
    centre: Vector = CENTRED

    def __post_init__(self) -> None:
        for name, value in self.dimensions.items():
            require_between(f"{name} of the {type(self).__name__.lower()}", value, SIZES, "m")

    @property
    def dimensions(self) -> dict[str, float]:
        """The dimensions by name [m]."""
        return {name: getattr(self, name) for name in _names(type(self))}

    @property
    @abstractmethod
    def body_shape(self) -> BodyShape:
        """The shape about the body's centre of mass."""

    def bullet(self) -> dict[str, Any]:
        """Arguments of ``createCollisionShape``."""
        return {"shapeType": self.geometry, **self.dimensions}

    @property
    def bounding_radius(self) -> float:
        """Bounding radius about the centre of mass [m]."""
        return self.body_shape.radius


def _names(made: type[_Shape]) -> list[str]:
    """Return the names of a shape's dimensions."""
    return [field.name for field in fields(made) if field.name != "centre"]  # type: ignore[arg-type]  # a dataclass


@dataclass(frozen=True)
class Sphere(_Shape):
    """A sphere."""

    kind, geometry = ShapeKind.BALL, pb.GEOM_SPHERE
    radius: float

    @property
    def body_shape(self) -> BodyShape:
        return BodyShape.ball(self.radius)


@dataclass(frozen=True)
class Box(_Shape):
    """A box of edge lengths x, y, z; ``centre`` is the position of its middle relative to the centre of mass [m]."""

    kind, geometry = ShapeKind.BOX, pb.GEOM_BOX
    x: float
    y: float
    z: float
    centre: Vector = field(default=CENTRED, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        centre = tuple(map(as_float, self.centre)) if isinstance(self.centre, Iterable) else ()
        good = len(centre) == 3 and all(abs(value) <= SIZES[1] for value in centre)  # False for NaN, too
        require(good, "geometry", "centre of the box", self.centre, f"three numbers, to {SIZES[1]:g} m")
        object.__setattr__(self, "centre", centre)

    @property
    def body_shape(self) -> BodyShape:
        return BodyShape.box((self.x, self.y, self.z), self.centre)

    def bullet(self) -> dict[str, Any]:
        half = [0.5 * self.x, 0.5 * self.y, 0.5 * self.z]
        return {"shapeType": self.geometry, "halfExtents": half, "collisionFramePosition": self.centre}


@dataclass(frozen=True, kw_only=True)
class Cylinder(_Shape):
    """A cylinder along z."""

    kind, geometry = ShapeKind.CYLINDER, pb.GEOM_CYLINDER
    height: float
    radius: float

    @property
    def body_shape(self) -> BodyShape:
        return BodyShape.cylinder(self.radius, self.height)


@dataclass(frozen=True, kw_only=True)
class Capsule(_Shape):
    """A capsule along z; ``height`` is the distance between the centres of its two half spheres."""

    kind, geometry = ShapeKind.CAPSULE, pb.GEOM_CAPSULE
    height: float
    radius: float

    @property
    def body_shape(self) -> BodyShape:
        return BodyShape.capsule(self.radius, self.height)


@dataclass(frozen=True)
class Hull(_Shape):
    """The convex hull of four ``vertices`` or more, about the position of a tracked body [m]."""

    kind, geometry = ShapeKind.HULL, pb.GEOM_MESH
    vertices: tuple[Vector, ...]

    def __post_init__(self) -> None:
        points = np.array(self.vertices, np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4 or not (np.abs(points) <= SIZES[1]).all():
            raise InputError("geometry", f"a hull needs four vertices or more, of three numbers to {SIZES[1]:g} m")
        object.__setattr__(self, "vertices", tuple((x, y, z) for x, y, z in points.tolist()))

    @property
    def dimensions(self) -> dict[str, float]:
        return {}

    @property
    def body_shape(self) -> BodyShape:
        return BodyShape.hull(np.array(self.vertices))

    @property
    def bounds(self) -> Box:
        """The box around the vertices."""
        return box_around(np.min(self.vertices, axis=0), np.max(self.vertices, axis=0))

    def bullet(self) -> dict[str, Any]:
        return {"shapeType": self.geometry, "vertices": self.vertices}


Shape = Sphere | Box | Cylinder | Capsule
# What tracked bodies can be.
Solid = Shape | Hull
SHAPES: dict[ShapeKind, type[Shape]] = {made.kind: made for made in get_args(Shape)}
# By the names that users write.
SHAPES_BY_NAME = {made.__name__.lower(): made for made in SHAPES.values()}
# Number of dimensions of the shapes of each kind; 0 = no shape has this number.
DIMENSIONS = np.zeros(max(SHAPES) + 1, np.int64)
DIMENSIONS[list(SHAPES)] = [len(_names(made)) for made in SHAPES.values()]


def shape_from(made: type[Shape], dimensions: Sequence[float]) -> Shape:
    """Return the shape with its ``dimensions`` [m] in the order of its class, which is that of the messages; raises
    `InputError` if their number is another."""
    names = _names(made)
    if len(dimensions) != len(names):
        name, order = made.__name__.upper(), ", ".join(names)
        raise InputError("shape", f"{name} needs {len(names)} dimensions [{order}], not {len(dimensions)}")
    sizes: dict[str, Any] = dict(zip(names, map(float, dimensions), strict=True))
    return made(**sizes)


def box_around(low: FloatArray, high: FloatArray) -> Box:
    """Return the box between two corners (3,) [m], within the possible sizes."""
    edges = np.clip(high - low, *SIZES).tolist()
    x, y, z = np.clip(0.5 * (low + high), -SIZES[1], SIZES[1]).tolist()
    return Box(*edges, centre=(x, y, z))


def padded_dimensions(shape: Shape) -> list[float]:
    """Return the dimensions of a shape in the order of its class, padded with zeros (3,) [m]."""
    dimensions = [float(value) for value in shape.dimensions.values()]
    return dimensions + [0.0] * (3 - len(dimensions))


def shape_of(kind: ShapeKind, dimensions: Sequence[float], centre: Sequence[float]) -> Shape:
    """Return the shape of a kind with `padded_dimensions` (3,) [m]; ``centre`` (3,) [m]: of boxes."""
    shape = shape_from(SHAPES[kind], dimensions[: int(DIMENSIONS[kind])])
    if isinstance(shape, Box):
        x, y, z = centre
        return replace(shape, centre=(x, y, z))
    return shape
