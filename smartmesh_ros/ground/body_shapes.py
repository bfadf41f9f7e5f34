"""Shapes of bodies and links, as users give them or as Bullet collides them."""

from __future__ import annotations

import math
from numbers import Integral
from typing import Any

import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError, listed, require
from smartmesh_ros.ground.layout_probe import number_of
from smartmesh_ros.ground.shapes import Solid, Sphere


def read_shapes(client: Any, body: int) -> dict[int, BodyShape]:
    """Return the shapes of those links of a body that have one, -1 = its base: what Bullet collides, meshes as their
    convex hulls. Raises `InputError` if the body is soft, or a robot that was loaded with ``useMaximalCoordinates``."""
    try:
        found: dict[int, BodyShape] = CORE.shapes_of(number_of(client), body)
    except ValueError as error:
        raise InputError("geometry", f"body {body} cannot stand on the ground: {error}") from None
    return found


def require_body(client: Any, body: Any, link: Any = None) -> None:
    """Raise `InputError`, which lists what there is, if PyBullet has no such body, or the body no such ``link`` (-1 =
    the base)."""
    try:
        client.getBodyInfo(body)
    except (pb.error, TypeError):
        client.syncBodyInfo()  # PyBullet's client may know only the last body of a batch
        bodies = [client.getBodyUniqueId(place) for place in range(client.getNumBodies())]
        there = f"there is {listed([*map(str, bodies)], 20)}" if bodies else "there is none yet"
        if body not in bodies or not isinstance(body, Integral):
            raise InputError(
                "unknown_body", f"PyBullet has no body {body!r}; pass the number that loadURDF or createMultiBody "
                f"returned: {there}"
            ) from None  # fmt: skip
        client.getBodyInfo(body)
    count = client.getNumJoints(body)
    if link is not None and (not isinstance(link, Integral) or link not in range(-1, count)):
        links = f"-1 (the base) to {count - 1}" if count else "-1 (the base) alone"
        raise InputError("unknown_body", f"body {body} has no link {link!r}; it has {links}")


def shapes_of(
    client: Any, body: int, link: int | None, shape: Solid | BodyShape | None, radius: float | None
) -> dict[int, BodyShape]:
    """Return the shapes of all links of a body that have one, or of one ``link``. The base's or link's is the given
    ``shape``, or a ball of the given ``radius`` [m], if there is one. Raises `InputError` if a shape has no size, and
    names the links that have a shape."""
    if radius is not None:
        if shape is not None:
            raise InputError("shape", f"body {body} is given a shape and a radius; give either")
        shape = Sphere(radius)
    given = shape.body_shape if isinstance(shape, Solid) else shape
    if not (given is None or isinstance(given, BodyShape)):
        raise InputError("shape", f"the shape of body {body} is {shape!r}; pass Sphere, Box, Cylinder or Capsule")
    found = read_shapes(client, body) if given is None else {-1 if link is None else link: given}
    if not found:
        raise InputError("geometry", f"body {body} has no collision shape, so nothing of it could touch the ground")
    if link is not None and link not in found:
        known = ", ".join(f"{other} {link_name(client, body, other)!r}" for other in found)
        raise InputError(
            "geometry", f"link {link} {link_name(client, body, link)!r} of body {body} has no collision shape; links "
            f"that have one: {known}. Without a link, the whole robot is attached"
        )  # fmt: skip
    if link is not None:
        found = {link: found[link]}
    for each, made in found.items():
        what = f"the radius of body {body}, link {each}"
        require(0.0 < made.radius < math.inf, "geometry", what, made.radius, "above zero [m]")
    return found


def link_name(client: Any, body: int, link: int) -> str:
    """Return the name of a link, or of the base (-1)."""
    name: bytes = client.getBodyInfo(body)[0] if link < 0 else client.getJointInfo(body, link)[12]
    return name.decode(errors="replace")


def link_names(client: Any, body: int) -> list[str]:
    """Return the names of all links of a body, the base first."""
    return [link_name(client, body, link) for link in range(-1, client.getNumJoints(body))]
