"""Service calls to the nodes of a fleet, which spawn bodies there, also again in their last known states."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from rclpy.node import Node
from rclpy.task import Future
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies

from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.transform import added
from smartmesh_ros.node.fleet.ledger import FleetBody
from smartmesh_ros.node.fleet.peers import topic_of
from smartmesh_ros.node.inputs.conversions import primitive_of
from smartmesh_ros.node.outputs.cdr import xyz
from smartmesh_ros.node.session import SERVICES
from smartmesh_ros.node.transport import publishers_on


class Calls:
    """Clients of the body services of all nodes. Every call is for all its bodies or none, and returns the reasons of
    refusals by body: empty = done. A call to a node that dies or restarts, or does not serve yet, is refused."""

    def __init__(self, front: Node, nodes: Iterable[str], group: Any) -> None:
        self._front = front
        self._clients = {
            (node, kind): front.create_client(kind, f"{node}/{name}", callback_group=group, qos_profile=SERVICES)
            for node in nodes
            for name, kind in (("spawn_bodies", SpawnBodies), ("remove_bodies", RemoveBodies))
        }
        # Of calls that are not answered yet: the node, and the publishers of its states when the call was made.
        self._open: dict[Future, tuple[str, frozenset[bytes]]] = {}

    async def spawn(self, node: str, bodies: Sequence[BodySpecification]) -> dict[str, str]:
        return await self._call(node, SpawnBodies, [body.id for body in bodies], bodies=bodies)

    async def remove(self, node: str, names: Sequence[str]) -> dict[str, str]:
        return await self._call(node, RemoveBodies, names, ids=names)

    def give_up(self, died: Collection[str]) -> None:
        """End the open calls to nodes that ``died``, and to those that restarted: DDS has other publishers of their
        states."""
        for future, (node, publishers) in [*self._open.items()]:
            ended = node in died or publishers_on(self._front, topic_of(node)) != publishers
            if ended and not future.done():
                future.set_result(None)

    async def _call(self, node: str, kind: Any, names: Sequence[str], **fields: Any) -> dict[str, str]:
        client = self._clients[node, kind]
        if not client.service_is_ready():
            return dict.fromkeys(names, f"{node} serves no calls yet")
        publishers = publishers_on(self._front, topic_of(node))
        future = client.call_async(kind.Request(**fields))
        self._open[future] = node, publishers
        response = await future
        del self._open[future]
        if response is None:
            return dict.fromkeys(names, f"{node} died before it answered")
        if not response.success and not response.failures:
            return dict.fromkeys(names, response.message)
        return {failure.id: failure.reason for failure in response.failures}


def same_as(request: Any) -> BodySpecification:
    """Return the BodySpecification with the fields of a SpawnBody request."""
    return BodySpecification(
        **{name: getattr(request, name) for name in BodySpecification.get_fields_and_field_types()}
    )


def specification_of(lost: FleetBody) -> BodySpecification:
    """Return the specification that spawns a lost body in its last state. The joints of a robot start at zero."""
    known = lost.request
    if lost.last is None:
        return known
    states, row = lost.last
    numbers = states.numbers[row].tolist()
    position, orientation = numbers[:3], numbers[3:7]
    body = BodySpecification(id=lost.name)
    if known is not None and known.urdf:
        body.urdf = known.urdf
    else:  # shapes are spawned at their geometric centre
        body.shape, body.mass = primitive_of(states.shape(row)), float(states.masses[row])
        position = added(position, rotate(orientation, states.centres[row].tolist()))
    body.pose = Pose(position=xyz(Point, position), orientation=xyz(Quaternion, orientation))
    body.twist = Twist(linear=xyz(Vector3, numbers[7:10]), angular=xyz(Vector3, numbers[10:]))
    return body
