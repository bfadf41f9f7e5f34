"""Real-time pacing of the physics, and conversion of stamps to simulated time."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Literal, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.timing.timeline import Timeline
from smartmesh_ros.stopwatch import Stopwatch

DeadlinePolicy = Literal["skip", "catch_up", "slow_down"]

# Largest backlog that the loop catches up with [s]. It drops a larger one, and simulated time falls behind real time.
MOST_CATCH_UP = 0.1
# The same on the clock of another simulator [s]. Larger, because its messages may be far apart.
MOST_JUMP = 1.0
# A stamp whose age on arrival [s] is within these limits is on this node's clock; any other comes from another clock.
OLDEST, NEWEST = 1.0, -0.05
# The loop has stalled if stamps of a source are more than this many times as far apart as their simulated times [-]. A
# loop that is overloaded for good may run that much slower than real time: its ground moves faster, but evenly.
STALL_RATIO = 4.0
# Gain of the filter that aligns another clock with this node's: share of the new offset in each message.
OFFSET_GAIN = 0.05


class Pacer:
    """Deadlines of a loop of fixed period, on the steady clock unless ``now`` gives another [s].

    ``lateness`` records the delay of each step. ``follows_clock``: the clock is another simulator's. Its messages
    release steps in bursts, which miss no deadline unless they are dropped, and it reads zero until its first message.
    ``deadline_missed``: the last step missed its deadline. ``paused``: the loop keeps its period without deadlines.

    A step misses its deadline if it has not started by the next deadline. The ``policy`` decides what follows:

    - *skip*: leave the missed steps out and keep the phase of the loop. `advance` returns their number, so that
      simulated time can advance without them.
    - *catch_up*: run the missed steps without waiting until the loop is on time again. A delay of more than
      `MOST_CATCH_UP` is dropped.
    - *slow_down*: set the next deadline one period after the late step. No step is left out, and none starts sooner
      than a period after the one before; simulated time runs slower than the clock.
    """

    def __init__(
        self, period: float, policy: DeadlinePolicy = "catch_up", now: Callable[[], float] = monotonic
    ) -> None:
        self.period = period
        self.policy = policy
        self.misses = 0
        self.deadline_missed = False
        self.paused = False
        self.most_catch_up = MOST_CATCH_UP
        self.follows_clock = False
        self.lateness = Stopwatch(("lateness",))
        self._now = now
        self._timeline = Timeline()
        self.deadline = now() + period
        self._waits_for_clock = False

    @property
    def overloaded(self) -> bool:
        """True if the loop cannot keep its period."""
        return self._timeline.overloaded(self.period)

    def restart(self) -> None:
        """Restarts the deadlines, after a pause or when the clock was set."""
        now = self._now()
        self._timeline.clear()
        self.deadline = now + self.period
        self._waits_for_clock = self.follows_clock and now == 0.0

    def pause(self, paused: bool) -> None:
        """Suspends the deadlines, or restarts them."""
        self.paused = paused
        self.restart()

    def remaining(self) -> float:
        """Return the time to the next deadline [s], negative after it."""
        if self._waits_for_clock and self._now() > 0.0:  # the first message of /clock: the wait for it is no delay
            self.restart()
        left = self.deadline - self._now()
        if left > self.period:  # the clock was set back, or the period became shorter
            self.deadline -= left - self.period
            return self.period
        return left

    def simulated_at(self, age: float, next_step: float) -> float:
        """Return the simulated time [s] of an instant ``age`` [s] ago, where ``next_step`` [s] is the simulated time of
        the next step: ``next_step`` minus the time that was left until its deadline.

        A late loop may take long to catch up. Maps would then lie in its future, and it would simulate on outdated
        ground; so the result is at most one period ahead of the next step. For an overloaded loop, simulated time is
        the straight line through its last steps. If steps are skipped, or follow another simulator's clock, simulated
        time catches up at once and needs no limit.
        """
        ahead = -min(self.remaining(), self.period)
        if self.follows_clock or self.policy == "skip":
            return next_step + ahead - age
        if self.overloaded:
            steps = self._timeline.steps_to(self._now() - age)
            return next_step + min(steps, 1.0) * self.period
        return next_step + min(ahead, self.period) - age

    def advance(self) -> int:
        """Records the start of the step that is due and sets the next deadline; returns the number of steps to skip."""
        if self.paused:
            self.deadline_missed = False
            self.deadline = self._now() + self.period
            return 0
        late = -self.remaining()
        self.lateness.note("lateness", max(late, 0.0))
        missed = int(late / self.period) if late > self.period else 0
        if self.follows_clock and late <= self.most_catch_up:
            missed = 0
        self.deadline_missed = missed > 0 and not self.follows_clock
        self._timeline.note(self._now())
        skipped = 0
        if missed and self.policy == "catch_up":
            # Later steps count as missed when they start, unless they are dropped now.
            dropped = late > self.most_catch_up
            self.misses += missed if dropped else 1
            self.deadline += late if dropped else 0.0
        elif missed and self.policy == "slow_down":
            self.misses += missed
            self.deadline += late
        elif missed:
            self.misses += missed
            self.deadline += missed * self.period
            skipped = missed
        self.deadline += self.period
        return skipped


class Placed(NamedTuple):
    """A stamp in simulated time.

    ``stamp`` [s] of the source's clock, None = the message has none. ``time`` [s]: simulated time. ``own``: the source
    uses this node's clock. ``lost`` [s]: simulated time that a stall of the loop took out since the last stamp.
    """

    stamp: float | None
    time: float
    own: bool = False
    lost: float = 0.0

    @property
    def source_time(self) -> float:
        """The stamp [s], or the simulated time if there is none: intervals between messages, whatever the loop did."""
        return self.time if self.stamp is None else self.stamp


class StampClock:
    """Converts the stamps of one source to simulated times; stamps must not decrease.

    Stamps on this node's clock are converted exactly. Stamps of another clock (of a simulator or a bag) keep their
    intervals, and an offset aligns them with their arrival. Messages without stamps get their time of arrival.
    """

    def __init__(self) -> None:
        self._last: Placed | None = None  # with a stamp

    def is_overtaken(self, stamp: float | None, most: float) -> bool:
        """Return True if a stamp is older than the last one by up to ``most`` [s], because messages were reordered."""
        return stamp is not None and self._last is not None and 0.0 < self._last.source_time - stamp <= most

    def place(
        self, stamp: float | None, clock_now: float, time_at: Callable[[float], float], most: float = 0.0
    ) -> Placed:
        """Return the simulated time of a stamp [s] that arrives at ``clock_now`` [s] of the node's clock.

        ``time_at(age)``: simulated time of an instant ``age`` [s] ago. A stamp that is older than the last one by up to
        ``most`` [s] gets the last one's time; an older one raises `InputError`. Changes nothing; see `accept`.
        """
        if stamp is None:
            return Placed(None, time_at(0.0))
        last = self._last
        if last is not None:
            stamp = self._in_order(stamp, last.source_time, most)
        age = clock_now - stamp
        # A stamp between the last one of this node's clock and now is late, not of another clock.
        own = NEWEST <= age <= OLDEST or (last is not None and last.own and age >= NEWEST)
        time = time_at(age) if own else self._aligned(stamp, time_at(0.0))
        return Placed(stamp, time, own, self._lost(stamp, time))

    def accept(self, placed: Placed) -> None:
        """Record that the message with this stamp was accepted."""
        if placed.stamp is not None:
            self._last = placed

    def _in_order(self, stamp: float, last: float, most: float) -> float:
        """Return a stamp [s], or the ``last`` one if that overtook it; raise `InputError` if it is older still."""
        if self.is_overtaken(stamp, most):
            return last
        if stamp < last:
            raise InputError(
                "stamp_backwards",
                f"stamp {stamp:.9f} s is older than the last one, {last:.9f} s; if the source's clock was set "
                "back, call ~/reset_terrain_clock for maps, or ~/reset for maps and bodies",
            )
        return stamp

    def _aligned(self, stamp: float, arrival: float) -> float:
        """Return the simulated time [s] of a stamp of another clock that arrives at a simulated time [s]."""
        offset = arrival - stamp
        if self._last is not None:
            before = self._last.time - self._last.source_time
            if abs(offset - before) < OLDEST:
                offset = before + OFFSET_GAIN * (offset - before)
        return stamp + offset

    def _lost(self, stamp: float, time: float) -> float:
        """Return the simulated time [s] that a stall took out between the last stamp and one at ``time`` [s]."""
        if self._last is None:
            return 0.0
        interval, simulated = stamp - self._last.source_time, time - self._last.time
        return interval - simulated if interval > STALL_RATIO * simulated else 0.0
