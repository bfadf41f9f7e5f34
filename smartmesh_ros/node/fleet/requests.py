"""Requests to spawn bodies again as they were."""

from __future__ import annotations

from typing import Any

from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.node.fleet.ledger import Respawning
from smartmesh_ros.physics.quaternions import rotate
from smartmesh_ros.physics.shapes import Box, Capsule, Shape, Sphere

FIELDS = ("id", "shape", "urdf", "mass", "pose", "twist")


def spawn_request(body: Any) -> SpawnBody.Request:
    """Return the request of a BodySpecification, or of a request itself."""
    return SpawnBody.Request(**{name: getattr(body, name) for name in FIELDS})


def specification_of(respawning: Respawning) -> BodySpecification:
    """What spawns a body where it was last; joints of a robot start at zero."""
    states, row = respawning.last
    known = respawning.request
    if states is None:
        return BodySpecification(**{name: getattr(known, name) for name in FIELDS})
    request = BodySpecification(id=respawning.name)
    if known is not None and known.urdf:
        request.urdf = known.urdf
    else:
        request.shape, request.mass = primitive_of(states.shape(row)), float(states.masses[row])
    numbers = states.numbers[row].tolist()
    if not request.urdf:  # a box is spawned about its middle
        away = rotate(numbers[3:7], states.centres[row].tolist())
        numbers[:3] = [value + by for value, by in zip(numbers[:3], away, strict=True)]
    position, orientation = request.pose.position, request.pose.orientation
    position.x, position.y, position.z = numbers[:3]
    orientation.x, orientation.y, orientation.z, orientation.w = numbers[3:7]
    for vector, values in ((request.twist.linear, numbers[7:10]), (request.twist.angular, numbers[10:])):
        vector.x, vector.y, vector.z = values
    return request


def primitive_of(shape: Shape) -> SolidPrimitive:
    """Return a shape as services take it; a capsule as the cylinder around it."""
    if isinstance(shape, Sphere):
        return SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[shape.radius])
    if isinstance(shape, Box):
        return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[shape.x, shape.y, shape.z])
    height = shape.height + (2.0 * shape.radius if isinstance(shape, Capsule) else 0.0)
    return SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[height, shape.radius])


def place_of(request: Any) -> tuple[float, float]:
    """Where a body is to start [m]."""
    return request.pose.position.x, request.pose.position.y
