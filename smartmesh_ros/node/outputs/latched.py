"""Latched outputs: late subscribers receive the last message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from smartmesh_ros.node.session import Session
from smartmesh_ros.node.transport import LATCHED

# Period of the check for changes [s].
PERIOD = 0.1


class LatchedOutput:
    """An output that is published when it has changed, from its first subscriber on: the message that a later one gets
    is never old. ``read``: returns what the message depends on; ``make``: returns the message of that. ``publisher``:
    of the messages."""

    def __init__(
        self, session: Session, kind: Any, topic: str, read: Callable[[], Any], make: Callable[[Any], Any]
    ) -> None:
        self._session, self._read, self._make = session, read, make
        self.publisher = session.publisher(kind, topic, LATCHED)
        self._sent: Any = None  # what the last message was made of; None = no subscribers so far
        self._due = 0.0

    def publish(self) -> None:
        """Publish the message if it is due and has changed."""
        now = self._session.clock.steady()
        if now < self._due:
            return
        self._due = now + PERIOD
        if self._sent is None and not self.publisher.get_subscription_count():
            return
        if (found := self._read()) != self._sent:
            self.publisher.publish(self._make(found))
            self._sent = found
