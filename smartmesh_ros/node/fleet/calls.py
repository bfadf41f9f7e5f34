"""Service calls to the nodes of a fleet. A call fails if its node dies before it answers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody

from smartmesh_ros.node.fleet.requests import spawn_request
from smartmesh_ros.node.session import SERVICES

KINDS = {
    "spawn_body": SpawnBody,
    "spawn_bodies": SpawnBodies,
    "remove_body": RemoveBody,
    "remove_bodies": RemoveBodies,
}


class Calls:
    """Clients of the body services of all nodes. A call to a node that dies returns a refusal."""

    def __init__(self, front: Node, nodes: Iterable[str], group: Any) -> None:
        self._clients = {
            (node, service): front.create_client(kind, f"{node}/{service}", callback_group=group, qos_profile=SERVICES)
            for node in nodes
            for service, kind in KINDS.items()
        }
        self._open: list[tuple[str, str, Any]] = []  # node, service, future

    async def spawn(self, node: str, body: Any) -> Any:
        """Ask a node to add a body; return its response."""
        return await self._call(node, "spawn_body", spawn_request(body))

    async def spawn_all(self, node: str, bodies: list[BodySpecification]) -> Any:
        """Ask a node to add all bodies or none; return its response."""
        return await self._call(node, "spawn_bodies", SpawnBodies.Request(bodies=bodies))

    async def remove(self, node: str, name: str) -> Any:
        """Ask a node to remove a body; return its response."""
        return await self._call(node, "remove_body", RemoveBody.Request(id=name))

    async def remove_all(self, node: str, names: list[str]) -> Any:
        """Ask a node to remove all bodies or none; return its response."""
        return await self._call(node, "remove_bodies", RemoveBodies.Request(ids=names))

    def give_up(self, node: str) -> None:
        """End the open calls to a node that died with refusals."""
        for owner, service, future in self._open:
            if owner == node and not future.done():
                future.set_result(_refusal(service, f"{node} died before it answered"))

    async def _call(self, node: str, service: str, request: Any) -> Any:
        client = self._clients[node, service]
        if not client.service_is_ready():
            return _refusal(service, f"{node} does not serve {service} yet")
        future: Future = client.call_async(request)
        self._open = [call for call in self._open if not call[2].done()]
        self._open.append((node, service, future))
        return await future


def _refusal(service: str, words: str) -> Any:
    return KINDS[service].Response(success=False, message=words)
