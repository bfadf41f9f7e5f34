"""Says that the physics waits for ``/clock``, for a node that follows it."""

from __future__ import annotations

from time import monotonic

from smartmesh_ros.node.outputs.clock_publishing import TOPIC
from smartmesh_ros.node.session import Session

# Time without a change of the clock after which the node says that it waits [s]. Longer than the pauses between the
# messages of slow clocks.
PATIENCE = 2.0


class ClockWatch:
    """Watches whether the clock that the node follows runs."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._seen, self._changed = 0.0, monotonic()  # the clock's time, and the steady time of its last change [s]
        self._said = ""

    def check(self) -> str:
        """Return what the physics waits for, empty = nothing, and log it if it is new."""
        clock, now = self._session.clock, monotonic()
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
