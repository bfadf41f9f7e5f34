"""The clocks of the sources of stamped messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.stamps import Placed, StampClock


class SourceClocks(dict[str, StampClock]):
    """The clocks of sources by their names. Of a source without one any next stamp is accepted. ``time_at``: returns
    the time [s] of the instant so long ago [s], None = simulated time."""

    def __init__(self, session: Session, time_at: Callable[[float], float] | None = None) -> None:
        super().__init__()
        self._session, self._time_at = session, time_at or session.time_at
        session.source_clocks.append(self)

    def of(self, source: str) -> StampClock:
        """Return the clock of a source; a new one if no message of it was accepted yet."""
        return self.get(source) or StampClock(lambda: self._session.pacer.interval)

    @contextmanager
    def placing(
        self, source: str, stamp: float | None, *, most: float = 0.0, horizon: float = math.inf
    ) -> Iterator[Placed]:
        """Give the block the stamp [s] of a message of a source in the time of ``time_at``; record the message as
        accepted unless the block raises. Log the first source whose stamps are ahead of this node's clock, and the
        first whose stamps are too old for it. ``most``, ``horizon``: as of `StampClock.place`."""
        session, clock = self._session, self.of(source)
        placed = clock.place(stamp, session.clock_now(), self._time_at, most, horizon, session.pacer.pace)
        yield placed
        clock.accept(placed)
        self[source] = clock
        # Maps may come before the first message of /clock.
        if session.waits_for_clock or not placed.fresh or placed.own or placed.stamp is None:
            return
        age = session.clock_now() - placed.stamp
        if any(other.is_foreign(ahead=age <= 0.0) for other in self.values() if other is not clock):
            return
        where = f"{age:.3f} s old" if age > 0.0 else f"{-age:.3f} s ahead of this node's clock"
        words = f"{source}: stamps are {where}, so they count as those of another clock, which hold when they arrive"
        if age > 0.0:
            session.node.get_logger().info(words)
        else:
            cure = "its publisher needs use_sim_time, too" if session.simulates_stamps else "set use_sim_time"
            session.node.get_logger().warning(f"{words}; {cure}, or synchronise the clocks")
