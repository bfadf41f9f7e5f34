"""Shapes of PyBullet's bodies and links as records of ``SHAPE``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.shapes import SHAPE, ShapeKind
from smartmesh_ros.physics.quaternions import rotate
from smartmesh_ros.physics.shapes import Box, Capsule, Shape, Sphere
from smartmesh_ros.physics.state import Quaternion, Vector
from smartmesh_ros.terrain.grid import FloatArray

CENTRE: Vector = (0.0, 0.0, 0.0)
UNTURNED: Quaternion = (0.0, 0.0, 0.0, 1.0)


def ball(radius: float, offset: Vector = CENTRE) -> Any:
    """A ball whose middle is at ``offset`` from the body's centre of mass."""
    return _record(ShapeKind.BALL, (radius,) * 3, offset, UNTURNED, radius)


def shape_record(shape: Shape) -> Any:
    """A shape about the body's centre of mass."""
    if isinstance(shape, Sphere):
        return ball(shape.radius)
    if isinstance(shape, Box):
        return _box((shape.x, shape.y, shape.z), shape.centre, UNTURNED)
    return _round(shape.radius, shape.height, CENTRE, UNTURNED, capped=isinstance(shape, Capsule))


def read_shape(client: Any, body: int, link: int = -1) -> Any:
    """Read the shape of a body or link from PyBullet.

    Several shapes become the box around all of them, a mesh becomes the box around it. If PyBullet does not report the
    shape, the result is the bounding ball. If the body has no shape, the radius is zero.
    """
    try:
        found = client.getCollisionShapeData(body, link)
    except pb.error:  # PyBullet does not report the shapes of bodies in maximal coordinates
        return ball(_radius_of_bounds(client, body, link))
    if not found:
        return ball(0.0)
    parts = [_part(kind, size, file, position, turn) for _, _, kind, size, file, position, turn in found]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return ball(_radius_of_bounds(client, body, link))
    return known[0] if len(known) == 1 else _box_around(known)


def shape_of(client: Any, body: int, link: int, shape: Shape | None, radius: float | None) -> Any:
    """Return the given ``shape``, or else a ball of the given ``radius`` [m], or else the shape that PyBullet reports;
    raises `InputError` if it has no size."""
    if shape is not None:
        record = shape_record(shape)
    else:
        record = read_shape(client, body, link) if radius is None else ball(radius)
    size = float(record["radius"])
    if not (math.isfinite(size) and size > 0.0):
        raise InputError("geometry", f"the radius of body {body}, link {link} is {size} m; it must be above zero")
    return record


def is_ball(shape: Any) -> bool:
    """Return True if a shape is a ball about the body's centre: inner edges take little of a ball's speed."""
    return bool(shape["kind"] == ShapeKind.BALL and not np.any(shape["offset"]))


def is_round(shape: Any) -> bool:
    """Return True if a shape is a cylinder or a capsule."""
    return bool(shape["kind"] == ShapeKind.ROUND)


def _box(edges: Iterable[float], offset: Vector, turn: Quaternion) -> Any:
    half = [0.5 * edge for edge in edges]
    return _record(ShapeKind.BOX, half, offset, turn, math.hypot(*half))


def _round(radius: float, height: float, offset: Vector, turn: Quaternion, *, capped: bool) -> Any:
    """A cylinder, or a ``capped`` capsule, whose ``height`` [m] excludes its half balls."""
    half = (radius, radius, 0.5 * height + (radius if capped else 0.0))
    return _record(ShapeKind.ROUND, half, offset, turn, half[2] if capped else math.hypot(*half[1:]))


def _record(kind: ShapeKind, half: Iterable[float], offset: Vector, turn: Quaternion, radius: float) -> Any:
    """A record of a shape with a bounding ``radius`` [m] about its own middle."""
    return np.array((kind, *half, offset, turn, radius + math.hypot(*offset)), SHAPE)


def _part(kind: int, size: Any, file: bytes, position: Vector, turn: Quaternion) -> Any:
    """One of a link's shapes; None if its size is unknown."""
    if kind == pb.GEOM_SPHERE:
        return ball(size[0], position)
    if kind == pb.GEOM_BOX:
        return _box(size, position, turn)
    if kind in (pb.GEOM_CYLINDER, pb.GEOM_CAPSULE):
        height, radius = size[0], size[1]
        return _round(radius, height, position, turn, capped=kind == pb.GEOM_CAPSULE)
    return None


def _box_around(parts: list[Any]) -> Any:
    """The box around several shapes, along the body's axes."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for part in parts:
        extent = _extent(part)
        low, high = np.minimum(low, part["offset"] - extent), np.maximum(high, part["offset"] + extent)
    x, y, z = (0.5 * (high + low)).tolist()
    return _box((high - low).tolist(), (x, y, z), UNTURNED)


def _extent(part: Any) -> FloatArray:
    """Half extents of a shape along the body's axes (3,) [m]."""
    half = np.array([part["half_x"], part["half_y"], part["half_z"]])
    if part["kind"] == ShapeKind.BALL:
        return half
    x, y, z, w = part["turn"].tolist()
    axes = np.array([rotate((x, y, z, w), axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
    return np.asarray(np.abs(axes).T @ half)


def _radius_of_bounds(client: Any, body: int, link: int) -> float:
    """Bounding radius, about the centre of mass, of the axis-aligned bounds [m]."""
    low, high = (np.array(corner) for corner in client.getAABB(body, link))
    pose = client.getBasePositionAndOrientation(body) if link < 0 else client.getLinkState(body, link)
    centre = np.array(pose[0])
    return float(np.linalg.norm(np.maximum(np.abs(low - centre), np.abs(high - centre))))
