"""Topics of which only the newest message is read, and only on request: the one module that uses rclpy's insides.

Nodes publish their states in every step. An executor that wakes for each message spends more time on that than on
reading the few that are needed. rclpy has no public way to take a message without an executor, so `Polled` keeps its
subscription from the executors by a callback group and calls ``handle.take_message``, as rclpy's executors do.
"""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from smartmesh_ros.node.fleet.peer_bodies import NEWEST_QOS


class _Never(ReentrantCallbackGroup):
    """Callback group that an executor never runs."""

    def can_execute(self, entity: Any) -> bool:
        return False


class Polled:
    """A subscription of message type ``kind`` for which DDS keeps only the newest message."""

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._kind, self._group = kind, _Never()
        self._subscription = node.create_subscription(
            kind, topic, lambda _: None, NEWEST_QOS, callback_group=self._group, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message as bytes; None if no message arrived since the last call."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._kind, True)
        return None if taken is None else taken[0]
