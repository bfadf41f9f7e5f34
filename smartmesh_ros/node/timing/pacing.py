"""The node's clock, and the real-time pacing of the physics by it."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any, Literal

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node

from smartmesh_ros.stopwatch import Stopwatch

DeadlinePolicy = Literal["skip", "catch_up", "slow_down"]

# Largest backlog that the loop catches up with [s]. It drops a larger one, and simulated time falls behind real time.
MOST_CATCH_UP = 0.1
# The same on the clock of another simulator [s]. Larger, because its messages may be far apart.
MOST_JUMP = 1.0
# Length of the window of last steps, an even number.
LENGTH = 32
# A loop is overloaded if both halves of the window, each without its longest step, took longer than this many periods
# per step: a stall is a single long step.
OVERLOAD = 1.02


class NodeClock:
    """The `Clock` of a node.

    Without ``use_sim_time`` the loop runs on the steady clock and stamps come from the system clock. With it both come
    from ``/clock``, and stand still while nobody publishes there.
    """

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self._jump_handle: Any = None

    steady = staticmethod(monotonic)

    @property
    def simulated(self) -> bool:
        return bool(self._clock.ros_time_is_active)

    def pace(self) -> float:
        return self.stamp_now() if self.simulated else self.steady()

    def stamp_now(self) -> float:
        return float(self._clock.now().nanoseconds) * 1e-9

    def on_set_back(self, act: Callable[[], None]) -> None:
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
        self._jump_handle = self._clock.create_jump_callback(threshold, post_callback=lambda _: act())


def stamp_of(seconds: float) -> Time:
    """Return a time [s] as a stamp, clamped to those that there are: from zero on, in 32 bits."""
    nanoseconds = min(max(round(seconds * 1e9), 0), 2**31 * 1_000_000_000 - 1)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


class Timeline:
    """The starts of the last steps.

    A loop that is always late starts each step when the one before ends, after a few long steps and many short ones.
    If maps took the simulated time of the step they arrive in, equal intervals between maps would become unequal by a
    factor of two, and the ground would jolt. The straight line through the starts keeps the intervals equal.
    """

    def __init__(self) -> None:
        self._starts = np.zeros(LENGTH)  # the newest last [s]
        self._steps = np.arange(LENGTH) - 0.5 * (LENGTH - 1)
        self._count = 0

    def clear(self) -> None:
        self._count = 0

    def note(self, start: float, longest: float) -> None:
        """Records a step that starts at ``start`` [s]; more than ``longest`` [s] after the last one, forgets those."""
        if start - self._starts[-1] > longest:
            self.clear()
        self._starts[:-1] = self._starts[1:]
        self._starts[-1] = start
        self._count += 1

    def overloaded(self, period: float) -> bool:
        """Return True if the loop cannot keep this ``period`` [s]."""
        if self._count < LENGTH:
            return False
        halves = np.split(np.diff(self._starts), [LENGTH // 2])
        return all(half.sum() - half.max() > OVERLOAD * period * (len(half) - 1) for half in halves)

    @property
    def rate(self) -> float:
        """Steps per second, by a least-squares line through the starts."""
        offsets = self._starts - self._starts.mean()
        return float((offsets @ self._steps) / (offsets @ offsets))

    def steps_to(self, instant: float) -> float:
        """Return the simulated time at ``instant`` [s], in steps after the next step (negative before it), on the line
        of `rate`."""
        return self.rate * (instant - float(self._starts.mean())) - 0.5 * (LENGTH + 1)


class Pacer:
    """Deadlines of a loop of fixed period, on the steady clock unless ``now`` gives another [s].

    ``lateness`` records the delay of each step. ``misses``, ``restarts``: numbers of missed deadlines and of restarts.
    ``follows_clock``: the clock is another simulator's. Its messages release steps in bursts, which miss no deadline
    unless they are dropped, and it reads zero until its first message. ``interval`` [s]: time from one of them to the
    next, at most `MOST_JUMP`; 0 for other clocks. ``paused``: the loop keeps its period without deadlines.

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
        self.misses = self.restarts = 0
        self.paused = False
        self.most_catch_up = MOST_CATCH_UP
        self.follows_clock = False
        self.interval = 0.0
        self.lateness = Stopwatch(("lateness",))
        self._now = now
        self._timeline = Timeline()
        self._seen = now()
        self.deadline = self._seen + period
        self._waits_for_clock = False

    @property
    def overloaded(self) -> bool:
        return self._timeline.overloaded(self.period)

    @property
    def pace(self) -> float:
        """Simulated time in a second of the clock, stalls left out [s]."""
        if self.follows_clock or self.policy == "skip" or not self.overloaded:
            return 1.0
        return self._timeline.rate * self.period

    def restart(self) -> None:
        """Restarts the deadlines, after a pause or when the clock was set."""
        now = self._now()
        self.restarts += 1
        self._timeline.clear()
        self.deadline = now + self.period
        self._seen = now
        if not self.follows_clock:
            self.interval = 0.0
        self._waits_for_clock = self.follows_clock and now == 0.0

    def pause(self, paused: bool) -> None:
        """Suspends the deadlines, or restarts them."""
        self.paused = paused
        self.restart()

    def remaining(self) -> float:
        """Return the time to the next deadline [s], negative after it."""
        if self._waits_for_clock and self._now() > 0.0:  # the first message of /clock: the wait for it is no delay
            self.restart()
        now = self._now()
        if self.follows_clock and now > self._seen:
            self.interval = min(now - self._seen, MOST_JUMP)
        self._seen = now
        left = self.deadline - now
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
        ahead = 0.0 if self._waits_for_clock else -min(self.remaining(), self.period)
        if self.follows_clock or self.policy == "skip":
            return next_step + ahead - age
        if self.overloaded:
            steps = self._timeline.steps_to(self._now() - age)
            return next_step + min(steps, 1.0) * self.period
        return next_step + min(ahead, self.period) - age

    def advance(self) -> int:
        """Records the start of the step that is due and sets the next deadline; returns the number of steps to skip."""
        if self.paused:
            self.deadline = self._now() + self.period
            return 0
        late = -self.remaining()
        self.lateness.note("lateness", max(late, 0.0))
        missed = int(late / self.period) if late > self.period else 0
        if self.follows_clock and late <= self.most_catch_up:
            missed = 0
        self._timeline.note(self._now(), self.most_catch_up + self.period)
        if missed and self.policy == "catch_up" and late <= self.most_catch_up:
            self.misses += 1  # later steps count as missed when they start
        elif missed:
            self.misses += missed
            self.deadline += missed * self.period if self.policy == "skip" else late
        self.deadline += self.period
        return missed if self.policy == "skip" else 0
