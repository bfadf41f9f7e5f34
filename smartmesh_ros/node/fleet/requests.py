"""Requests that spawn bodies on a node, also again in their last known states."""

from __future__ import annotations

from typing import Any

from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification

from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Capsule, Shape
from smartmesh_ros.node.fleet.ledger import Respawning
from smartmesh_ros.node.inputs.conversions import SOLIDS


def same_as(request: Any) -> BodySpecification:
    """Return the BodySpecification with the fields of a SpawnBody request."""
    return BodySpecification(
        **{name: getattr(request, name) for name in BodySpecification.get_fields_and_field_types()}
    )


def specification_of(respawning: Respawning) -> BodySpecification:
    """Return the specification that spawns a body in its last state. The joints of a robot start at zero."""
    (states, row), known = respawning.last, respawning.request
    if states is None:
        return known
    body = BodySpecification(id=respawning.name)
    numbers = states.numbers[row].tolist()
    if known is not None and known.urdf:
        body.urdf = known.urdf
    else:  # shapes are spawned at their geometric centre
        body.shape, body.mass = primitive_of(states.shape(row)), float(states.masses[row])
        away = rotate(numbers[3:7], states.centres[row].tolist())
        numbers[:3] = [value + by for value, by in zip(numbers[:3], away, strict=True)]
    orientation = body.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = numbers[3:7]
    vectors = (body.pose.position, numbers[:3]), (body.twist.linear, numbers[7:10]), (body.twist.angular, numbers[10:])
    for vector, values in vectors:
        vector.x, vector.y, vector.z = values
    return body


def primitive_of(shape: Shape) -> SolidPrimitive:
    """Return a shape as SolidPrimitive. A capsule becomes its bounding cylinder."""
    if isinstance(shape, Capsule):
        height = shape.height + 2.0 * shape.radius
        return SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[height, shape.radius])
    [(kind, order)] = [(kind, order) for kind, (made, order) in SOLIDS.items() if isinstance(shape, made)]
    values = dict(zip(order, shape.dimensions.values(), strict=True))
    return SolidPrimitive(type=kind, dimensions=[values[index] for index in range(len(order))])
