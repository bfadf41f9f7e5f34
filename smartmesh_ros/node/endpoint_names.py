"""Names of the nodes at the other ends of topics.

DDS discovery finds a publisher or subscription before the name of its node arrives. Programs that use DDS without ROS
never send a name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic
from typing import Any

# What the graph calls a node whose name has not arrived.
UNKNOWN = "_NODE_NAME_UNKNOWN_"
# How long to wait for a name before its owner counts as a program without ROS [s].
PATIENCE = 5.0
NAMELESS = "a DDS participant without a ROS name"
# Endpoints without a name that are remembered at most; raising it costs memory only.
MOST_REMEMBERED = 1000


class EndpointNames:
    """Full names of nodes. Remembers when each endpoint without a name was seen first, on the clock ``now`` [s]."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._first_seen: dict[tuple[int, ...], float] = {}

    def of(self, endpoint: Any) -> str | None:
        """The full name of the node of a `TopicEndpointInfo`; None while the name may still arrive."""
        key = tuple(endpoint.endpoint_gid)
        if UNKNOWN not in (endpoint.node_name, endpoint.node_namespace):
            self._first_seen.pop(key, None)
            return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
        if len(self._first_seen) >= MOST_REMEMBERED:
            self._first_seen.clear()
        waited = self._now() - self._first_seen.setdefault(key, self._now())
        return NAMELESS if waited > PATIENCE else None

    def of_all(self, endpoints: Iterable[Any]) -> list[str] | None:
        """The distinct names of several, sorted; None while any of them may still arrive."""
        names = {self.of(endpoint) for endpoint in endpoints}
        return None if None in names else sorted(name for name in names if name is not None)
