"""Wall-clock pacing of the physics, and how stamps relate to simulated time."""

from __future__ import annotations

from time import monotonic

from smartmesh_ros.errors import InputError

# A loop that is later than this gives the lost time up instead of catching up: simulated time then falls behind [s].
MOST_CATCH_UP = 0.1
# A stamp between these ages on arrival [s] is on our clock; any other comes from a clock of its own.
OLDEST, NEWEST = 1.0, -0.05


class Pacer:
    """Deadlines of a loop of fixed period on the steady clock."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.misses = 0
        self.deadline = monotonic() + period

    def restart(self) -> None:
        """Starts anew, after a pause."""
        self.deadline = monotonic() + self.period

    def remaining(self) -> float:
        """Time to the next deadline [s]; negative when it is over."""
        return self.deadline - monotonic()

    def advance(self) -> None:
        """Notes that the work of this deadline is starting, and sets the next one."""
        late = -self.remaining()
        if late > self.period:
            self.misses += 1
        if late > MOST_CATCH_UP:
            self.deadline += late
        self.deadline += self.period


class StampClock:
    """Simulated times of the stamps of one source, which never run backwards.

    Stamps on our own clock are placed exactly. Stamps of another clock (a simulator's, a bag's) keep their distances
    and are aligned with their arrival. A source that sets no stamps is placed by arrival.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._offset: float | None = None

    def place(self, stamp: float | None, clock_now: float, time_now: float) -> float:
        """Simulated time [s] of a stamp that arrives when the node's clock says ``clock_now`` and simulated time is
        ``time_now``. Raises `InputError` if it is older than the one before; nothing is changed until `accept`."""
        if stamp is None:
            return time_now
        if self._last is not None and stamp < self._last:
            raise InputError(
                "stamp_backwards",
                f"stamp {stamp:.9f} s is older than the last one, {self._last:.9f} s; call ~/reset if the source's "
                "clock was set back",
            )
        age = clock_now - stamp
        if NEWEST <= age <= OLDEST:
            return time_now - age
        offset = time_now - stamp
        if self._offset is not None and abs(offset - self._offset) < OLDEST:
            offset = self._offset + 0.05 * (offset - self._offset)
        return stamp + offset

    def accept(self, stamp: float | None, time: float) -> None:
        """Notes that the message of this stamp was taken, at that simulated time."""
        if stamp is not None:
            self._last = stamp
            self._offset = time - stamp
