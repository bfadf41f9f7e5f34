"""What is measured of a world: its simulated bodies and their links, as far as their shapes are known exactly."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.quaternions import product, rotate
from smartmesh_ros.physics.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.physics.state import Quaternion, Vector
from smartmesh_ros.physics.world import World


class Part(NamedTuple):
    """A shape of a body or link, which lies at ``offset`` [m] and ``turn`` in its frame of inertia. ``free``: a body of
    its own, which nothing but the ground holds up."""

    body: str
    uid: int
    link: int
    shape: Shape
    offset: Vector = (0.0, 0.0, 0.0)
    turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
    free: bool = True

    @property
    def key(self) -> tuple[str, int, Vector]:
        """What tells it from others in every run."""
        return self.body, self.link, self.offset


class Pose(NamedTuple):
    """Where a part is [m] and how it is turned."""

    position: Vector
    orientation: Quaternion


def parts_of(world: World) -> list[Part]:
    """All parts of the simulated bodies that are spheres, boxes, cylinders or capsules."""
    found: list[Part] = []
    for body in world.bodies.values():
        if body.tracked:
            continue
        if body.shape is not None:
            found.append(Part(body.name, body.uid, -1, body.shape))
        else:
            found += _links(world.client, body)
    return found


def pose_of(client: Any, part: Part) -> Pose:
    """Where a part is now."""
    if part.link < 0:
        position, orientation = client.getBasePositionAndOrientation(part.uid)
    else:
        position, orientation = client.getLinkState(part.uid, part.link, computeForwardKinematics=1)[:2]
    x, y, z = np.add(position, rotate(orientation, part.offset)).tolist()
    return Pose((x, y, z), product(orientation, part.turn))


def _links(client: Any, body: Body) -> list[Part]:
    found = []
    for link in body.links:
        for _, _, kind, size, _, offset, turn in client.getCollisionShapeData(body.uid, link):
            try:
                shape = _shape(kind, size)
            except InputError:  # smaller or larger than anything that is measured
                continue
            if shape is not None:
                found.append(Part(body.name, body.uid, link, shape, tuple(offset), tuple(turn), free=False))
    return found


def _shape(kind: int, size: Any) -> Shape | None:
    """A shape as PyBullet tells it; None of a mesh, whose surface is not known exactly."""
    if kind == pb.GEOM_SPHERE:
        return Sphere(size[0])
    if kind == pb.GEOM_BOX:
        return Box(*size)
    if kind == pb.GEOM_CYLINDER:
        return Cylinder(size[1], size[0])
    if kind == pb.GEOM_CAPSULE:
        return Capsule(size[1], size[0])
    return None
