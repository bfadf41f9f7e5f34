"""Shapes of bodies and links, as users give them or as PyBullet reports them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.patches.shapes import BodyShape, ball, compound, hull, primitive
from smartmesh_ros.terrain.grid import FloatArray

# Margin by which PyBullet's loader grows the hulls of links [m]; ``changeDynamics`` changes that of base links only.
HULL_MARGIN = 1e-3


def read_shape(client: Any, body: int, link: int = -1) -> BodyShape:
    """Read the shape of a body or link from PyBullet: what PyBullet collides, meshes as their convex hulls.

    If PyBullet does not report the shape, or the file of a mesh cannot be read, the result is the bounding ball. If the
    body has no shape, the radius is zero.
    """
    try:
        found = client.getCollisionShapeData(body, link)
    except pb.error:  # PyBullet does not report the shapes of bodies in maximal coordinates
        return ball(_radius_of_bounds(client, body, link))
    if not found:
        return ball(0.0)
    parts: list[BodyShape] = []
    for index, (_, _, kind, size, file, position, turn) in enumerate(found):
        if kind == pb.GEOM_MESH:
            margin = _margin(client, body, link, alone=len(found) == 1)
            hulls = _hulls(client, body, link, index, (size, file, position, turn))
            known = [hull(points, margin) for points in hulls]
        else:
            simple = primitive(pb, kind, size, position, turn)
            known = [] if simple is None else [simple]
        if not known:
            return ball(_radius_of_bounds(client, body, link))
        parts += known
    return compound(parts)


# Most bodies that a message lists.
MOST_LISTED = 20


def require_body(client: Any, body: int, link: int | None = None) -> None:
    """Raise `InputError`, which lists what there is, if PyBullet has no such body, or the body no such ``link`` (-1 =
    the base)."""
    try:
        client.getBodyInfo(body)
    except (pb.error, TypeError):
        bodies = [client.getBodyUniqueId(place) for place in range(client.getNumBodies())]
        if body in bodies:
            raise  # PyBullet failed
        known = ", ".join(map(str, bodies[:MOST_LISTED])) + (" ..." if len(bodies) > MOST_LISTED else "")
        there = f"there is {known}" if bodies else "there is none yet"
        raise InputError(
            "unknown_body", f"PyBullet has no body {body!r}; pass the number that loadURDF or createMultiBody "
            f"returned: {there}"
        ) from None  # fmt: skip
    if link is not None and link not in range(-1, count := client.getNumJoints(body)):
        links = f"-1 (the base) to {count - 1}" if count else "-1 (the base) alone"
        raise InputError("unknown_body", f"body {body} has no link {link!r}; it has {links}")


def shape_of(client: Any, body: int, link: int, shape: Shape | BodyShape | None, radius: float | None) -> BodyShape:
    """Return the given ``shape``, or else a ball of the given ``radius`` [m], or else the shape that PyBullet reports;
    raises `InputError` if it has no size, and names the links that have a shape."""
    if shape is None and radius is None:
        require_shape(client, body, link)
    if isinstance(shape, BodyShape):
        made = shape
    elif shape is not None:
        made = shape.body_shape
    else:
        made = read_shape(client, body, link) if radius is None else ball(radius)
    if not (math.isfinite(made.radius) and made.radius > 0.0):
        raise InputError(
            "geometry", f"the radius of body {body}, link {link} is {made.radius} m; it must be above zero"
        )
    return made


def links_with_shape(client: Any, body: int) -> list[int]:
    """Return the links of a body that have a collision shape, -1 = its base; raises `InputError` if there are none."""
    links = [link for link in range(-1, client.getNumJoints(body)) if _has_shape(client, body, link)]
    if not links:
        raise InputError("geometry", f"body {body} has no collision shape, so nothing of it could touch the ground")
    return links


def require_shape(client: Any, body: int, link: int) -> None:
    """Raise `InputError`, which names the links that have a collision shape, if a link has none."""
    if not _has_shape(client, body, link):
        known = ", ".join(f"{other} {link_name(client, body, other)!r}" for other in links_with_shape(client, body))
        raise InputError(
            "geometry",
            f"link {link} {link_name(client, body, link)!r} of body {body} has no collision shape; links that have "
            f"one: {known}. Without a link, the whole robot is attached",
        )


def _has_shape(client: Any, body: int, link: int) -> bool:
    try:
        return bool(client.getCollisionShapeData(body, link))
    except pb.error:  # PyBullet does not report the shapes of bodies in maximal coordinates
        return True


def link_name(client: Any, body: int, link: int) -> str:
    """Return the name of a link, or of the base (-1)."""
    name: bytes = client.getBodyInfo(body)[0] if link < 0 else client.getJointInfo(body, link)[12]
    return name.decode(errors="replace")


def _hulls(
    client: Any, body: int, link: int, index: int, mesh: tuple[Vector, bytes, Vector, Quaternion]
) -> list[FloatArray]:
    """Return the points (n, 3) [m] of the hulls that PyBullet makes of a mesh, in the frame of the centre of mass; none
    if they are unknown.

    PyBullet makes a hull of each object of an OBJ file, but returns the points of the last one only, so such files are
    read here. All other meshes, and cylinders that are no primitives in PyBullet, are one hull.
    """
    scale, file, position, turn = mesh
    path = file.decode(errors="replace")
    objects = obj_parts(path) if path.lower().endswith(".obj") else [np.empty((0, 3))]
    if len(objects) != 1:
        axes = np.array([rotate(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
        return [points * scale @ axes + position for points in objects]
    count, points = client.getMeshData(body, link, index)
    return [np.array(points, np.float64)] if count else []


def _margin(client: Any, body: int, link: int, *, alone: bool) -> float:
    """Return the margin by which PyBullet grows a hull [m]."""
    told = float(client.getDynamicsInfo(body, link)[11])
    return told if link < 0 and alone else max(told, HULL_MARGIN)


def _radius_of_bounds(client: Any, body: int, link: int) -> float:
    """Bounding radius, about the centre of mass, of the axis-aligned bounds [m]."""
    low, high = (np.array(corner) for corner in client.getAABB(body, link))
    pose = client.getBasePositionAndOrientation(body) if link < 0 else client.getLinkState(body, link)
    centre = np.array(pose[0])
    return float(np.linalg.norm(np.maximum(np.abs(low - centre), np.abs(high - centre))))


def obj_parts(path: str) -> list[FloatArray]:
    """Return the points (n, 3) that the faces of each object or group of an OBJ file use; an empty list if the file
    cannot be read."""
    try:
        lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    points: list[list[float]] = []
    objects: list[set[int]] = [set()]
    for line in lines:
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            points.append([float(word) for word in words[1:4]])
        elif words[0] in ("o", "g"):
            objects.append(set())
        elif words[0] == "f":
            numbers = [int(word.partition("/")[0]) for word in words[1:]]
            objects[-1].update(number - 1 if number > 0 else len(points) + number for number in numbers)
    array = np.array(points, np.float64).reshape(-1, 3)
    return [array[sorted(used)] for used in objects if used]
