"""Requests that respawn bodies in their last known states."""

from __future__ import annotations

from typing import Any

from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Box, Capsule, Shape, Sphere
from smartmesh_ros.node.fleet.ledger import Respawning

FIELDS = ("id", "shape", "urdf", "mass", "pose", "twist", "on_ground", "clearance", "align")


def spawn_request(body: Any) -> SpawnBody.Request:
    """Return the SpawnBody request for a BodySpecification or for another request."""
    return SpawnBody.Request(**{name: getattr(body, name) for name in FIELDS})


def specification_of(respawning: Respawning) -> BodySpecification:
    """Return the specification that spawns a body in its last state. The joints of a robot start at zero."""
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
    if not request.urdf:  # shapes are spawned at their geometric centre
        away = rotate(numbers[3:7], states.centres[row].tolist())
        numbers[:3] = [value + by for value, by in zip(numbers[:3], away, strict=True)]
    position, orientation = request.pose.position, request.pose.orientation
    position.x, position.y, position.z = numbers[:3]
    orientation.x, orientation.y, orientation.z, orientation.w = numbers[3:7]
    for vector, values in ((request.twist.linear, numbers[7:10]), (request.twist.angular, numbers[10:])):
        vector.x, vector.y, vector.z = values
    return request


def primitive_of(shape: Shape) -> SolidPrimitive:
    """Return a shape as SolidPrimitive. A capsule becomes its bounding cylinder."""
    if isinstance(shape, Sphere):
        return SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[shape.radius])
    if isinstance(shape, Box):
        return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[shape.x, shape.y, shape.z])
    height = shape.height + (2.0 * shape.radius if isinstance(shape, Capsule) else 0.0)
    return SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[height, shape.radius])


def place_of(request: Any) -> tuple[float, float]:
    """Return the start position (x, y) [m] of a spawn request."""
    return request.pose.position.x, request.pose.position.y
