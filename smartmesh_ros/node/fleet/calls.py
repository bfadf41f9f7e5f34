"""Service calls to the nodes of a fleet."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies

from smartmesh_ros.node.session import SERVICES


class Calls:
    """Clients of the body services of all nodes. Every call is for all its bodies or none, and returns the reasons of
    refusals by body: empty = done. A call to a node that dies, or does not serve yet, is refused."""

    def __init__(self, front: Node, nodes: Iterable[str], group: Any) -> None:
        self._clients = {
            (node, kind): front.create_client(kind, f"{node}/{name}", callback_group=group, qos_profile=SERVICES)
            for node in nodes
            for name, kind in (("spawn_bodies", SpawnBodies), ("remove_bodies", RemoveBodies))
        }
        self._open: list[tuple[str, Future]] = []

    async def spawn(self, node: str, bodies: Sequence[BodySpecification]) -> dict[str, str]:
        """Ask a node to add bodies."""
        return await self._call(node, SpawnBodies, [body.id for body in bodies], bodies=bodies)

    async def remove(self, node: str, names: Sequence[str]) -> dict[str, str]:
        """Ask a node to remove bodies."""
        return await self._call(node, RemoveBodies, names, ids=names)

    def give_up(self, node: str) -> None:
        """End the open calls to a node that died."""
        for owner, future in self._open:
            if owner == node and not future.done():
                future.set_result(None)

    async def _call(self, node: str, kind: Any, names: Sequence[str], **fields: Any) -> dict[str, str]:
        client = self._clients[node, kind]
        if not client.service_is_ready():
            return dict.fromkeys(names, f"{node} serves no calls yet")
        future = client.call_async(kind.Request(**fields))
        self._open = [(node, future), *(call for call in self._open if not call[1].done())]
        response = await future
        if response is None:
            return dict.fromkeys(names, f"{node} died before it answered")
        if not response.success and not response.failures:
            return dict.fromkeys(names, response.message)
        return {failure.id: failure.reason for failure in response.failures}
