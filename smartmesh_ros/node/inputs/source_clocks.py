"""The clocks of the sources of stamped messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.stamps import Placed, StampClock


class SourceClocks:
    """A clock for each source, by its name."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._clocks: dict[str, StampClock] = {}
        session.source_clocks.append(self._clocks)

    def of(self, source: str) -> StampClock:
        """Return the clock of a source; a new one if no message of it was accepted yet."""
        return self._clocks.get(source) or self._session.stamp_clock()

    def forget(self, source: str | None = None) -> None:
        """Accept any next stamp of a source, None = of all."""
        if source is None:
            self._clocks.clear()
        else:
            self._clocks.pop(source, None)

    @contextmanager
    def placing(
        self,
        source: str,
        stamp: float | None,
        *,
        time_at: Callable[[float], float] | None = None,
        most: float = 0.0,
        horizon: float = math.inf,
    ) -> Iterator[Placed]:
        """Give the block the stamp [s] of a message of a source in simulated time, or in that of ``time_at``; record
        the message as accepted unless the block raises. ``most``, ``horizon``: as of `StampClock.place`."""
        session, clock = self._session, self.of(source)
        placed = clock.place(stamp, session.clock_now(), time_at or session.time_at, most, horizon, session.pacer.pace)
        yield placed
        self._note(source, placed)
        clock.accept(placed)
        self._clocks[source] = clock

    def _note(self, source: str, placed: Placed) -> None:
        """Log a line if the stamps of a source, of which this is the first, are not on this node's clock, once that
        runs: maps may come before the first message of ``/clock``."""
        session = self._session
        if session.waits_for_clock or not placed.fresh or placed.own or placed.stamp is None:
            return
        age = session.clock_now() - placed.stamp
        where = f"{age:.3f} s old" if age > 0.0 else f"{-age:.3f} s ahead of this node's clock"
        words = f"{source}: stamps are {where}, so they count as those of another clock, which hold when they arrive"
        if age > 0.0:
            session.node.get_logger().info(words)
        else:
            cure = "" if session.clock.simulated else "set use_sim_time, or "
            session.node.get_logger().warning(f"{words}; {cure}synchronise the clocks")
