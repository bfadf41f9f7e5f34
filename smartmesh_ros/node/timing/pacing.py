"""Wall-clock pacing of the physics, and how stamps relate to simulated time."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Literal

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.timing.timeline import Timeline
from smartmesh_ros.stopwatch import Stopwatch

DeadlinePolicy = Literal["skip", "catch_up", "slow_down"]

# A loop that is later than this gives the lost time up instead of catching up: simulated time then falls behind [s].
MOST_CATCH_UP = 0.1
# The same on the clock of another simulator, whose messages may be that far apart [s].
MOST_JUMP = 1.0
# A stamp between these ages on arrival [s] is on our clock; any other comes from a clock of its own.
OLDEST, NEWEST = 1.0, -0.05


class Pacer:
    """Deadlines of a loop of fixed period, on the steady clock unless ``now`` gives another [s].

    ``lateness`` collects how late the steps started. ``follows``: whether the clock is another simulator's. Its steps
    come in bursts, which miss no deadline unless they are given up, and it reads zero until its first message.
    ``late``: whether the last step missed its deadline. ``paused``: whether the loop beats without deadlines.

    A deadline is missed when its step has not started by the time of the next one. What then happens is the ``policy``:

    - *skip*: the missed steps are left out and the beat is kept. `advance` returns how many there were, so that
      simulated time can go on without them.
    - *catch_up*: the missed steps run one right after the other until the loop is on its beat again. What is more than
      `MOST_CATCH_UP` late is given up.
    - *slow_down*: the next deadline is one period after the late step, so that no step is left out and none follows
      the one before sooner than a period; simulated time runs slower than the clock.
    """

    def __init__(
        self, period: float, policy: DeadlinePolicy = "catch_up", now: Callable[[], float] = monotonic
    ) -> None:
        self.period = period
        self.policy = policy
        self.misses = 0
        self.late = False
        self.paused = False
        self.most_catch_up = MOST_CATCH_UP
        self.follows = False
        self.lateness = Stopwatch(("lateness",))
        self._now = now
        self._timeline = Timeline()
        self.deadline = now() + period
        self._waits_for_clock = False

    @property
    def behind(self) -> bool:
        """Whether the loop cannot keep up."""
        return self._timeline.behind(self.period)

    def restart(self) -> None:
        """Starts anew, after a pause or when the clock was set."""
        now = self._now()
        self._timeline.clear()
        self.deadline = now + self.period
        self._waits_for_clock = self.follows and now == 0.0

    def pause(self, paused: bool) -> None:
        """Has the loop miss no deadlines from now on, or starts its beat anew."""
        self.paused = paused
        self.restart()

    def remaining(self) -> float:
        """Time to the next deadline [s]; negative when it is over."""
        if self._waits_for_clock and self._now() > 0.0:  # the first message: the time before it was no delay
            self.restart()
        left = self.deadline - self._now()
        if left > self.period:  # the clock was set back, or the period became shorter
            self.deadline -= left - self.period
            return self.period
        return left

    def simulated_at(self, age: float, next_step: float) -> float:
        """Simulated time [s] of an instant ``age`` [s] ago: that of the ``next_step`` [s], less what was left until it
        is due.

        A loop that is late may not catch up for long. It would take every map for one of a time yet to come, and stand
        on the ground before; so this instant is no further ahead of the next step than a period. For one that is late
        all the time, simulated time is the straight line that it ran along lately. Where simulated time goes on at once
        to what the clock tells, as it does where steps are left out, or follow another simulator's clock, every instant
        is what it is.
        """
        ahead = -min(self.remaining(), self.period)
        if self.follows or self.policy == "skip":
            return next_step + ahead - age
        if self.behind:
            steps = self._timeline.steps_to(self._now() - age)
            return next_step + min(steps, 1.0) * self.period
        return next_step + min(ahead, self.period) - age

    def advance(self) -> int:
        """Notes that the work of this deadline is starting, and sets the next one; returns the steps to leave out."""
        if self.paused:
            self.late = False
            self.deadline = self._now() + self.period
            return 0
        late = -self.remaining()
        self.lateness.note("lateness", max(late, 0.0))
        missed = int(late / self.period) if late > self.period else 0
        if self.follows and late <= self.most_catch_up:
            missed = 0
        self.late = missed > 0 and not self.follows
        self._timeline.note(self._now())
        skipped = 0
        if missed and self.policy == "catch_up":
            # The others that are late by now are counted when their turn comes, unless they are given up.
            given_up = late > self.most_catch_up
            self.misses += missed if given_up else 1
            self.deadline += late if given_up else 0.0
        elif missed and self.policy == "slow_down":
            self.misses += missed
            self.deadline += late
        elif missed:
            self.misses += missed
            self.deadline += missed * self.period
            skipped = missed
        self.deadline += self.period
        return skipped


class StampClock:
    """Simulated times of the stamps of one source, which never run backwards.

    Stamps on our own clock are placed exactly. Stamps of another clock (a simulator's, a bag's) keep their distances
    and are aligned with their arrival. A source that sets no stamps is placed by arrival.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._offset: float | None = None

    def is_late(self, stamp: float | None, late: float) -> bool:
        """Whether a stamp is older than the last one by up to ``late`` [s]: messages have overtaken each other."""
        return stamp is not None and self._last is not None and 0.0 < self._last - stamp <= late

    def place(
        self, stamp: float | None, clock_now: float, time_at: Callable[[float], float], late: float = 0.0
    ) -> float:
        """Simulated time [s] of a stamp that arrives when the node's clock says ``clock_now``; ``time_at``: simulated
        time of an instant so many seconds ago. Raises `InputError` if the stamp is older than the one before; nothing
        is changed until `accept`. One that is older by up to ``late`` [s] is placed where that one is."""
        if stamp is None:
            return time_at(0.0)
        if self._last is not None and self.is_late(stamp, late):
            stamp = self._last
        if self._last is not None and stamp < self._last:
            raise InputError(
                "stamp_backwards",
                f"stamp {stamp:.9f} s is older than the last one, {self._last:.9f} s; if the source's clock was set "
                "back, call ~/reset_terrain_clock for maps, or ~/reset for maps and bodies",
            )
        age = clock_now - stamp
        if NEWEST <= age <= OLDEST:
            return time_at(age)
        offset = time_at(0.0) - stamp
        if self._offset is not None and abs(offset - self._offset) < OLDEST:
            offset = self._offset + 0.05 * (offset - self._offset)
        return stamp + offset

    def accept(self, stamp: float | None, time: float) -> None:
        """Notes that the message of this stamp was taken, at that simulated time."""
        if stamp is not None and not (self._last is not None and stamp < self._last):
            self._last = stamp
            self._offset = time - stamp
