"""The measured parts of a world: simulated bodies and links with primitive shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product, rotate
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.world import World

# Shapes from PyBullet's sizes. The surface of a mesh is not measured.
_SHAPES: Mapping[int, Callable[[Sequence[float]], Shape]] = {
    pb.GEOM_SPHERE: lambda size: Sphere(size[0]),
    pb.GEOM_BOX: lambda size: Box(*size),
    pb.GEOM_CYLINDER: lambda size: Cylinder(size[1], size[0]),
    pb.GEOM_CAPSULE: lambda size: Capsule(size[1], size[0]),
}


class Part(NamedTuple):
    """A shape of a body or link, with position ``offset`` [m] and orientation ``turn`` in the link's inertial frame.
    ``free``: True for a body without joints, which only the ground supports."""

    body: str
    uid: int
    link: int
    shape: Shape
    offset: Vector = (0.0, 0.0, 0.0)
    turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
    free: bool = True


class Pose(NamedTuple):
    """Position [m] and orientation of a part."""

    position: Vector
    orientation: Quaternion


def parts_of(world: World) -> list[Part]:
    """Return all parts of simulated bodies that are spheres, boxes, cylinders or capsules."""
    found: list[Part] = []
    for body in (body for body in world.bodies.values() if not body.tracked):
        if body.shape is None:
            found += _links(world.client, body)
        else:
            found.append(Part(body.name, body.uid, -1, body.shape))
    return found


def pose_of(client: Any, part: Part) -> Pose:
    """Return the present pose of a part."""
    if part.link < 0:
        position, orientation = client.getBasePositionAndOrientation(part.uid)
    else:
        position, orientation = client.getLinkState(part.uid, part.link, computeForwardKinematics=1)[:2]
    x, y, z = np.add(position, rotate(orientation, part.offset)).tolist()
    return Pose((x, y, z), product(orientation, part.turn))


def _links(client: Any, body: Body) -> Iterator[Part]:
    for link in body.links:
        for _, _, kind, size, _, offset, turn in client.getCollisionShapeData(body.uid, link):
            if kind in _SHAPES:
                with suppress(InputError):  # outside the range of sizes that is measured
                    yield Part(body.name, body.uid, link, _SHAPES[kind](size), tuple(offset), tuple(turn), free=False)
