"""Topics whose newest message is taken when it is wanted, rather than every message when it comes."""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from smartmesh_ros.node.fleet.peer_bodies import NEWEST


class _Never(CallbackGroup):
    """Has an executor leave subscriptions alone: to wake it for a message costs more than the message."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing was begun."""


class Polled:
    """A topic of ``kind``, of which DDS keeps the newest message."""

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._kind = kind
        self._group = _Never()
        self._subscription = node.create_subscription(
            kind, topic, _ignore, NEWEST, callback_group=self._group, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message as bytes, None if none has come since the last call."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._kind, True)
        return None if taken is None else taken[0]


def _ignore(_: bytes) -> None:
    """Is never called."""
