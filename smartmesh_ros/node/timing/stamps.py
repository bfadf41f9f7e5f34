"""Conversion of stamps of any clock to simulated time."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from smartmesh_ros.errors import InputError

# A first stamp whose age on arrival [s] is within these limits is on this node's clock; any other comes from another
# clock. Under simulated time stamps may be ahead by one more interval of ``/clock``, which messages of a tick may
# overtake. A source of a clock that is behind changes to this node's clock if its stamps are at most half as old.
OLDEST, NEWEST = 1.0, -0.05
# The loop has stalled if stamps of another clock are more than this many times as far apart as their simulated times
# [-]. That clock may be so much faster than this node's, as of a recording that is played fast.
STALL_RATIO = 4.0
# Errors of times by rounding [s].
ROUNDING = 1e-6
# Gain of the filter that measures the steady delay of a source: share of the deviation of a message's age.
DELAY_GAIN = 0.05
# The delay in use follows the measured one at this distance [s], so that jitter leaves the intervals between stamps as
# they are.
DELAY_SLACK = 0.05
# Number of messages whose longest delay is expected of the next one.
DELAYS_KEPT = 30


def stamp_seconds(stamp: Any) -> float | None:
    """Return a stamp in seconds; None if it is not set (zero)."""
    if stamp.sec < 0 or not 0 <= stamp.nanosec < 1_000_000_000:
        raise InputError("stamp", f"stamp {stamp.sec} s {stamp.nanosec} ns is not a time; nanosec is 0 to 999999999")
    if stamp.sec == 0 and stamp.nanosec == 0:
        return None
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


class Placed(NamedTuple):
    """A stamp in simulated time.

    ``stamp`` [s] of the source's clock, None = the message has none. ``time`` [s]: simulated time. ``own``: the source
    uses this node's clock. ``fresh``: no stamp before is on the same clock. ``lost`` [s]: simulated time that stalls of
    the loop took out since the last stamp, negative if it made up for them. ``measured``, ``used`` [s]: steady age of
    the source's stamps, as measured and as in use. ``late`` [s]: simulated time from ``time`` to the arrival.
    """

    stamp: float | None
    time: float
    own: bool = False
    fresh: bool = False
    lost: float = 0.0
    measured: float = 0.0
    used: float = 0.0
    late: float = 0.0

    @property
    def source_time(self) -> float:
        """The stamp [s], or the simulated time if there is none: intervals between messages, whatever the loop did."""
        return self.time if self.stamp is None else self.stamp


class StampClock:
    """Converts the stamps of one source to simulated times; stamps on one clock must not decrease.

    Stamps on this node's clock are converted exactly. Stamps of another clock (of a simulator or a bag) keep their
    intervals, and their steady age is added, so that they hold on arrival. Messages without stamps get their time of
    arrival. A source that changes to or from this node's clock starts anew. ``interval``: returns
    `Pacer.interval`.
    """

    def __init__(self, interval: Callable[[], float] = float) -> None:
        self._interval = interval
        self._last: Placed | None = None  # with a stamp
        self._late: deque[float] = deque(maxlen=DELAYS_KEPT)

    @property
    def delay(self) -> float:
        """Expected time from the instant of the next message to its arrival [s]: the longest of the last messages."""
        return max(self._late, default=0.0)

    @property
    def age(self) -> float | None:
        """Steady age of the stamps on arrival, on this node's clock [s]; None without stamps."""
        return None if self._last is None else self._last.measured

    def is_foreign(self, *, ahead: bool) -> bool:
        """Return True if the stamps are on a clock that is ``ahead`` of this node's, or else on one that is behind."""
        return self._last is not None and not self._last.own and (self._last.measured <= 0.0) == ahead

    def is_overtaken(self, stamp: float | None, clock_now: float, most: float) -> bool:
        """Return True if a stamp that arrives at ``clock_now`` [s] is older than the last one of the same clock by up
        to ``most`` [s], because messages were reordered."""
        last = None if stamp is None else self._last_on_its_clock(clock_now - stamp)
        return stamp is not None and last is not None and 0.0 < last.source_time - stamp <= most

    def place(
        self,
        stamp: float | None,
        clock_now: float,
        time_at: Callable[[float], float],
        most: float = 0.0,
        horizon: float = math.inf,
        pace: float = 1.0,
    ) -> Placed:
        """Return the simulated time of a stamp [s] that arrives at ``clock_now`` [s] of the node's clock.

        ``time_at(age)``: simulated time of an instant ``age`` [s] ago. ``pace``: simulated time in a second, but for
        stalls [s]. A stamp that is older than the last one by up to ``most`` [s] gets the last one's time; an older one
        raises `InputError`. A source that is steadily late by more than the ``horizon`` [s] holds that much before its
        arrival. Changes nothing; see `accept`.
        """
        now = time_at(0.0)
        if stamp is None:
            return Placed(None, now)
        own, last = self._is_own(clock_now - stamp), self._last_on_its_clock(clock_now - stamp)
        if last is not None and self.is_overtaken(stamp, clock_now, most):
            stamp = last.source_time
        if last is not None and stamp < last.source_time:
            words = f"stamp {stamp:.9f} s is older than the last one, {last.source_time:.9f} s; if the source's clock"
            cure = "call ~/reset_terrain_clock for maps, or ~/reset for maps and bodies"
            raise InputError("stamp_backwards", f"{words} was set back, {cure}")
        age = clock_now - stamp
        measured, used = _delays(last, age, own)
        added = min(max(used - horizon, 0.0), max(age, 0.0)) if own else used
        if last is None:
            time = time_at(age - added)
            return Placed(stamp, time, own, True, 0.0, measured, used, now - time)
        # Equal stamps are at equal times, whatever rounding.
        time = last.time if stamp == last.source_time else time_at(age - added)
        return Placed(stamp, time, own, False, _lost(last, stamp, time, pace), measured, used, now - time)

    def accept(self, placed: Placed) -> None:
        if placed.stamp is None:
            return
        if placed.fresh:
            self._late.clear()
        self._late.append(min(max(placed.late, 0.0), OLDEST))
        self._last = placed

    def _is_own(self, age: float) -> bool:
        """Return True if a stamp of this ``age`` [s] is on this node's clock."""
        last, newest = self._last, NEWEST - self._interval()
        if last is not None and last.own:  # a stamp between that one and now is late, not of another clock
            return age >= newest
        return newest <= age <= (OLDEST if last is None or last.measured < 0.0 else 0.5 * OLDEST)

    def _last_on_its_clock(self, age: float) -> Placed | None:
        """Return the last stamp if it is on the same clock as one of this ``age`` [s], else None. No clock is both
        ahead of this node's and behind it."""
        last, own = self._last, self._is_own(age)
        if last is None or last.own != own or not (own or (last.measured < 0.0) == (age < 0.0)):
            return None
        return last


def _delays(last: Placed | None, age: float, own: bool) -> tuple[float, float]:
    """Return the steady age of the stamps after one of this ``age``, as measured and as in use [s]."""
    if last is None or (not own and abs(age - last.measured) >= OLDEST):
        return age, age
    measured = last.measured + DELAY_GAIN * min(max(age - last.measured, -OLDEST), OLDEST)
    return measured, min(max(last.used, measured - DELAY_SLACK), measured + DELAY_SLACK)


def _lost(last: Placed, stamp: float, time: float, pace: float) -> float:
    """Return the simulated time [s] that stalls took out between the last stamp and one at ``time`` [s]."""
    interval, simulated = stamp - last.source_time, time - last.time
    if last.own:
        lost = pace * interval - simulated
        return lost if abs(lost) > ROUNDING else 0.0
    return interval - simulated if interval > STALL_RATIO * simulated else 0.0
