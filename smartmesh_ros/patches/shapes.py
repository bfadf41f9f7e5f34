"""Shapes of bodies: constructors, and the tables in which the core finds them.

A convex shape is a *core* (point, segment, box, cylinder, or hull of vertices), grown by a rounding radius.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE, as_bytes, dtype_of
from smartmesh_ros.patches.tables import with_rows
from smartmesh_ros.terrain.grid import FloatArray


class ShapeKind(IntEnum):
    """Kind of a shape, by its core: BOX; BALL, a point; CYLINDER, about z; CAPSULE, a segment along z; HULL, the convex
    hull of vertices; COMPOUND, several of these. Numbered as in smartmesh_msgs/TrackedBody and BodyDescription."""

    NONE = 0
    BOX = 1
    BALL = 2
    CYLINDER = 3
    CAPSULE = 6
    HULL = 8
    COMPOUND = 9


# ``kind``: a `ShapeKind`; ``half`` extents of the core along the shape's axes and ``rounding`` radius [m]; ``offset``
# [m] and ``orientation`` (x, y, z, w): pose of the shape in the frame of the body's centre of mass; ``bounding_radius``
# [m]: about the shape's middle; ``radius`` [m]: bounding radius about the centre of mass; ``first``,
# ``rows``: first row and number of a hull's vertices, or of a compound's parts.
SHAPE = dtype_of(CORE.SHAPE)

# Columns of a table of bodies (N, 13): position [m], orientation (x, y, z, w), velocity [m/s], angular velocity
# [rad/s].
BODY_COLUMNS = 13
# A hull of many vertices keeps enough of them that none is farther outside than this [m].
MOST_GROWTH = 1e-3

CENTRE = (0.0, 0.0, 0.0)
UNROTATED = (0.0, 0.0, 0.0, 1.0)


def directions(count: int) -> FloatArray:
    """Return unit directions (count, 3), evenly spread (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    aside = np.sqrt(1.0 - z * z)
    return np.column_stack([aside * np.cos(angle), aside * np.sin(angle), z])


# Among the vertices of a hull those farthest along these directions are tried first.
DIRECTIONS = directions(64)


@dataclass(frozen=True, eq=False)
class BodyShape:
    """One shape: a ``record`` of ``SHAPE``, whose ``first`` is not yet known; a hull's ``vertices`` (n, 3) about its
    middle [m]; a compound's ``parts``."""

    record: Any
    vertices: FloatArray | None = None
    parts: tuple[BodyShape, ...] = ()

    @property
    def kind(self) -> ShapeKind:
        """Kind of the shape."""
        return ShapeKind(int(self.record["kind"]))

    @property
    def radius(self) -> float:
        """Bounding radius about the body's centre of mass [m]."""
        return float(self.record["radius"])


def ball(radius: float, offset: Sequence[float] = CENTRE) -> BodyShape:
    """A ball whose middle is at ``offset`` from the body's centre of mass [m]."""
    return _shape(ShapeKind.BALL, CENTRE, radius, 0.0, offset, UNROTATED)


def capsule(
    radius: float, height: float, offset: Sequence[float] = CENTRE, orientation: Sequence[float] = UNROTATED
) -> BodyShape:
    """A capsule along z, whose half balls are ``height`` [m] apart."""
    return _shape(ShapeKind.CAPSULE, (0.0, 0.0, 0.5 * height), radius, 0.5 * height, offset, orientation)


def box(
    edges: Sequence[float], offset: Sequence[float] = CENTRE, orientation: Sequence[float] = UNROTATED
) -> BodyShape:
    """A box of three edge lengths [m]."""
    half = [0.5 * edge for edge in edges]
    return _shape(ShapeKind.BOX, half, 0.0, math.hypot(*half), offset, orientation)


def cylinder(
    radius: float, height: float, offset: Sequence[float] = CENTRE, orientation: Sequence[float] = UNROTATED
) -> BodyShape:
    """A cylinder along z."""
    half = (radius, radius, 0.5 * height)
    return _shape(ShapeKind.CYLINDER, half, 0.0, math.hypot(radius, 0.5 * height), offset, orientation)


def part_of(record: bytes, points: FloatArray) -> BodyShape:
    """A convex shape by the bytes of its record, or of a hull by its points (n, 3) [m]."""
    part = np.frombuffer(record, SHAPE).reshape(()).copy()
    return hull(points, float(part["rounding"])) if part["kind"] == ShapeKind.HULL else BodyShape(part)


def hull(points: FloatArray, rounding: float = 0.0) -> BodyShape:
    """The convex hull of points (n, 3) [m] in the frame of the centre of mass, grown by ``rounding`` [m].

    Of many points, so many are left out that no point is more than a millimetre outside the hull of the rest. The hull
    then grows by the distance of the farthest point outside.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    vertices, growth = _fewer(np.ascontiguousarray(points - middle))
    bounding_radius = float(np.linalg.norm(vertices, axis=1).max())
    shape = _shape(ShapeKind.HULL, half.tolist(), rounding + growth, bounding_radius, middle.tolist(), UNROTATED)
    shape.record["rows"] = len(vertices)
    return BodyShape(shape.record, vertices)


def compound(parts: Sequence[BodyShape]) -> BodyShape:
    """Several shapes on one body, or the shape itself if there is only one."""
    if len(parts) == 1:
        return parts[0]
    low = np.min([part.record["offset"] - _extent(part.record) for part in parts], axis=0)
    high = np.max([part.record["offset"] + _extent(part.record) for part in parts], axis=0)
    middle = 0.5 * (low + high)
    inner = []
    for part in parts:
        record = part.record.copy()
        record["offset"] -= middle
        record["radius"] = record["bounding_radius"] + math.hypot(*record["offset"])
        inner.append(BodyShape(record, part.vertices))
    bounding_radius = max(part.radius for part in inner)
    shape = _shape(ShapeKind.COMPOUND, (0.5 * (high - low)).tolist(), 0.0, bounding_radius, middle.tolist(), UNROTATED)
    shape.record["rows"] = len(inner)
    return BodyShape(shape.record, None, tuple(inner))


def _shape(
    kind: ShapeKind, half: Sequence[float], rounding: float, core: float, offset: Sequence[float],
    orientation: Sequence[float],
) -> BodyShape:  # fmt: skip
    """A shape whose core has a bounding radius ``core`` [m] about its middle."""
    bounding_radius = core + rounding
    values = (kind, half, rounding, offset, orientation, bounding_radius, bounding_radius + math.hypot(*offset), 0, 0)
    return BodyShape(np.array(values, SHAPE))


def _extent(record: Any) -> FloatArray:
    """Half extents of a shape along the body's axes (3,) [m], or more."""
    x, y, z, w = record["orientation"].tolist()
    axes = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return np.asarray(np.abs(axes) @ record["half"] + record["rounding"])


def fewer_vertices(vertices: FloatArray, count: int) -> FloatArray:
    """Return vertices (k, 3) [m] of a hull (n, 3): those farthest along ``count`` directions, and enough others that
    none is farther than a millimetre outside their hull."""
    return _fewer(vertices, directions(count))[0]


def _fewer(vertices: FloatArray, along: FloatArray = DIRECTIONS) -> tuple[FloatArray, float]:
    """Return the vertices (n, 3) of a hull that are kept, and how far the others are outside their hull [m]."""
    if len(vertices) <= len(along):
        return vertices, 0.0
    kept, others, growth = _extreme(vertices, along), vertices, 0.0
    while len(others):
        away = np.empty(len(others))
        CORE.distances_outside(kept, others, away)
        growth = max(growth, float(away.max(where=away <= MOST_GROWTH, initial=0.0)))
        others = others[away > MOST_GROWTH]
        if len(others):
            kept = np.concatenate([kept, _extreme(others, DIRECTIONS)])
    return kept, growth


def _extreme(vertices: FloatArray, along: FloatArray) -> FloatArray:
    """Return the vertices that are farthest along one of some directions (d, 3), after scaling all to equal extents
    along each axis, so that thin parts keep as many as others."""
    extents = np.ptp(vertices, axis=0)
    evened = vertices / np.where(extents > 0.0, extents, 1.0)
    farthest = [(evened @ part.T).argmax(axis=0) for part in np.array_split(along, -(-len(along) // len(DIRECTIONS)))]
    return np.ascontiguousarray(vertices[np.unique(np.concatenate(farthest))])


class ShapeTable:
    """The shapes of all bodies by slot: ``table`` (S,), records of ``SHAPE``; ``parts`` (P,) of compounds, records of
    ``SHAPE``; ``vertices`` (V, 3) of hulls [m]. Vertices and parts that are equal are stored once, and kept."""

    def __init__(self) -> None:
        self.table: Any = np.zeros(0, SHAPE)
        self.parts: Any = np.zeros(0, SHAPE)
        self.vertices: FloatArray = np.empty((0, 3))
        self._first_vertices: dict[bytes, int] = {}  # by content
        self._first_parts: dict[bytes, int] = {}
        self._core: Any = None

    @property
    def core(self) -> Any:
        """The shapes as the core reads them."""
        if self._core is None:
            self._core = CORE.Shapes(as_bytes(self.table), as_bytes(self.parts), self.vertices)
        return self._core

    def reserve(self, slots: int) -> None:
        """Make room for shapes in ``slots`` slots."""
        self.table, self._core = with_rows(self.table, slots, 0), None

    def put(self, slot: int, shape: BodyShape) -> None:
        """Set the shape of a slot."""
        self.table[slot] = self._stored(shape)
        self._core = None

    def _stored(self, shape: BodyShape) -> Any:
        """Return a shape's record, after storing its vertices or parts."""
        record = shape.record.copy()
        if shape.vertices is not None:
            key = shape.vertices.tobytes()
            if key not in self._first_vertices:
                self._first_vertices[key] = len(self.vertices)
                self.vertices = np.concatenate([self.vertices, shape.vertices])
            record["first"] = self._first_vertices[key]
        elif shape.parts:
            parts = np.array([self._stored(part) for part in shape.parts], SHAPE)
            key = parts.tobytes()
            if key not in self._first_parts:
                self._first_parts[key] = len(self.parts)
                self.parts = np.concatenate([self.parts, parts])
            record["first"] = self._first_parts[key]
        return record
