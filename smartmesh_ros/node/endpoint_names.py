"""Names of the peer nodes on topics.

DDS discovery finds a publisher or subscription before its node's name arrives. DDS programs without ROS never send one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic
from typing import Any

from rclpy.node import Node

# Name in the ROS graph of a node whose name has not arrived.
UNKNOWN = "_NODE_NAME_UNKNOWN_"
# Time without a name after which an endpoint counts as a program without ROS [s].
NAME_TIMEOUT = 5.0
NAMELESS = "a DDS participant without a ROS name"
# Most nameless endpoints to remember; a higher number costs memory only.
MOST_REMEMBERED = 1000


class EndpointNames:
    """Looks up full node names, and stores when each nameless endpoint was first seen, on the clock ``now`` [s]."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._first_seen: dict[tuple[int, ...], float] = {}

    def of(self, endpoint: Any) -> str | None:
        """Return the full node name of a `TopicEndpointInfo`; None while the name may still arrive."""
        key = tuple(endpoint.endpoint_gid)
        if UNKNOWN not in (endpoint.node_name, endpoint.node_namespace):
            self._first_seen.pop(key, None)
            return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
        if len(self._first_seen) >= MOST_REMEMBERED:
            self._first_seen.clear()
        waited = self._now() - self._first_seen.setdefault(key, self._now())
        return NAMELESS if waited > NAME_TIMEOUT else None

    def of_publishers(self, node: Node, topics: Iterable[str]) -> list[str] | None:
        """Return the distinct names of the nodes that publish on ``topics``, as ``node`` sees them, sorted; None while
        one of them may still arrive."""
        names = {self.of(peer) for topic in topics for peer in node.get_publishers_info_by_topic(topic)}
        return None if None in names else sorted(name for name in names if name is not None)
