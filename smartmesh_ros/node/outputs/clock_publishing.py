"""``/clock``: simulated time for other nodes if this node is its source, or else a watch on that of another node."""

from __future__ import annotations

from typing import Any

from rosgraph_msgs.msg import Clock

from smartmesh_ros.node.endpoints import names_of
from smartmesh_ros.node.outputs.rates import Rhythm
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.node.session import Session

TOPIC = "/clock"


class ClockPublishing:
    """Publishes simulated time at the rate ``publish.clock``; a rate of zero removes the publisher.

    Publishes nothing while another node publishes on the topic, because time would jump back and forth for every
    subscriber. ``rivals``: names of these nodes.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._publisher: Any = None
        self._rhythm = Rhythm()
        self.rivals: list[str] = []

    def publish(self, now: float) -> None:
        """Publishes the clock if it is due at the steady time ``now`` [s]."""
        node, rate = self._session.node, self._session.settings.publish.clock
        if not rate:
            if self._publisher is not None:
                node.destroy_publisher(self._publisher)
            self._publisher, self.rivals = None, []
            return
        if not self._rhythm.is_due(now, rate):
            return
        if self._publisher is None:
            self._publisher = node.create_publisher(Clock, TOPIC, 10)
        if node.count_publishers(self._publisher.topic_name) > 1:
            self._note_rivals()
            return
        self.rivals = []
        self._publisher.publish(Clock(clock=self._session.stamp_now()))

    def _note_rivals(self) -> None:
        node = self._session.node
        names = names_of(node.get_publishers_info_by_topic(self._publisher.topic_name))
        self.rivals = [name for name in names if name != node.get_fully_qualified_name()] or ["another node"]
        node.get_logger().error(
            f"{TOPIC} is published by {', '.join(self.rivals)} already, so this node is silent there; set "
            "publish.clock to 0 and use_sim_time to true to follow that clock",
            throttle_duration_sec=LOG_PERIOD,
        )


# Time without a change of the clock after which the node says that it waits [s]. Longer than the pauses between the
# messages of slow clocks.
PATIENCE = 2.0


class ClockWatch:
    """Watches whether the clock that the node follows runs; without it the physics waits."""

    def __init__(self, session: Session) -> None:
        self._session = session
        # The clock's time, and the steady time of its last change [s].
        self._seen, self._changed = 0.0, session.clock.steady()
        self._said = ""

    def check(self) -> str:
        """Return what the physics waits for, empty = nothing, and log it if it is new."""
        clock, now = self._session.clock, self._session.clock.steady()
        seen = clock.stamp_now()
        if not clock.simulated or seen != self._seen:
            self._seen, self._changed = seen, now
        said = "" if now - self._changed < PATIENCE else self._reason()
        if said and said != self._said:
            self._session.node.get_logger().warning(f"use_sim_time is set: the physics {said}")
        self._said = said
        return said

    def _reason(self) -> str:
        node = self._session.node
        topic = node.resolve_topic_name(TOPIC)
        if not node.count_publishers(topic):
            return f"waits for {topic}, which nobody publishes"
        return f"waits for {topic}, which stands still" if self._seen else f"waits for the first message on {topic}"
