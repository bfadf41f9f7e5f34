"""Topics that are polled: only the newest message is read, and only on request."""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from smartmesh_ros.node.fleet.peer_bodies import NEWEST_QOS


class _Never(CallbackGroup):
    """Callback group that an executor never runs, because waking the executor costs more than reading a message."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: no execution ever begins."""


class Polled:
    """A subscription of message type ``kind`` for which DDS keeps only the newest message."""

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._kind = kind
        self._group = _Never()
        self._subscription = node.create_subscription(
            kind, topic, _ignore, NEWEST_QOS, callback_group=self._group, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message as bytes; None if no message arrived since the last call."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._kind, True)
        return None if taken is None else taken[0]


def _ignore(_: bytes) -> None:
    """Do nothing. Never called; a subscription needs a callback."""
