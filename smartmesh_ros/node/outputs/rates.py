"""When outputs are published, and who has received what of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from smartmesh_ros.ground.bullet import undone
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.world.world import ROUNDING, World

# Longest time between two messages with all patches in incremental mode [s].
ALL_PATCHES_PERIOD = 5.0
# Time in which a new subscriber may not have discovered the node and so misses messages [s].
DISCOVERY_TIME = 3.0
# Rate of the check of latched outputs for changes [Hz].
LATCHED_RATE = 10.0


class RateTime:
    """Time by which the rates of outputs count [s]: simulated time where stamps are simulated, or else steady time. A
    pause of a node that publishes ``/clock`` takes steady time, too. Starts at zero and never goes back."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._time, self._before = 0.0, (False, 0.0)

    def read(self) -> float:
        session = self._session
        simulated = session.simulates_stamps and not (session.paused and session.settings.publish.clock)
        now = session.state_time() if simulated else session.clock.steady()
        if self._before[0] == simulated:
            self._time += max(now - self._before[1], 0.0)
        self._before = simulated, now
        return self._time + ROUNDING * session.world.dt


class Rhythm:
    """The times at which one output is due, by a rate that may change. ``first``: the first of them [s]."""

    def __init__(self, first: float = 0.0) -> None:
        self._due = first

    def is_due(self, time: float, rate: float, *, now: bool = False) -> bool:
        """Return True at a ``time`` [s] if the output of a ``rate`` [Hz] is due, or is to be ``now``; then the next one
        is due a period later. A late or an early message does not shift the phase, unless a whole period was missed."""
        period = 1.0 / rate
        self._due = min(self._due, time + period)  # the rate was lower before
        if not now and time < self._due:
            return False
        following = min(self._due, time) + period
        self._due = following if following > time else time + period
        return True


class Beat:
    """The steps of a world in which an output of a ``rate`` in simulated time [Hz] is due."""

    def __init__(self, world: World, rate: float) -> None:
        self._world, self._rate, self._turn = world, rate, -1

    def is_due(self, *, now: bool) -> bool:
        """Return True once for each period, and if it is to be ``now``."""
        turn = self._world.periods(self._rate)
        due, self._turn = now or turn != self._turn, turn
        return due


class Output:
    """An output on the private topic ``name`` that has a rate. ``make``: returns its message, or a list of messages.
    ``rhythm``: of the messages."""

    def __init__(self, session: Session, kind: Any, name: str, make: Callable[[], Any]) -> None:
        self.make, self._session, self._name = make, session, name
        self.publisher = session.publisher(kind, f"~/{name}")
        self.rhythm = Rhythm()
        self._subscribers = 0  # of the last message
        self._counts = (0, 0)  # of subscribers and publishers
        self._new_until = self._all_due = -math.inf

    def publish(self, time: float, *, now: bool = False, idle: bool = False) -> None:
        """Publish the message, if there are subscribers and it is due at the ``time`` by which rates count [s], or
        ``now``; if ``idle``, also if there are more subscribers than at the last message or call."""
        session, before = self._session, self._subscribers
        rate = session.settings.publish.of(self._name)
        if idle and not now:
            self._subscribers = self.publisher.get_subscription_count()
            now = self._subscribers > before
        if rate <= 0.0 or not self.rhythm.is_due(time, rate, now=now):
            return
        with session.enduring(self._name):
            self._subscribers = self.publisher.get_subscription_count()
            if not self._subscribers:
                return
            with session.world.stopwatch.stage("publish"), undone(partial(setattr, self, "_all_due", -math.inf)):
                made = self.make()
                for message in made if isinstance(made, list) else [made]:
                    self.publisher.publish(message)

    @property
    def new(self) -> bool:
        """True if some subscribers may have missed messages, or another publisher may have made them forget some."""
        return self._session.clock.steady() < self._new_until

    def needs_all(self) -> bool:
        """Return False if the next message may contain only changes. New subscribers, and every `ALL_PATCHES_PERIOD`
        all subscribers, receive everything."""
        now = self._session.clock.steady()
        counts = self._subscribers, self._session.node.count_publishers(self.publisher.topic_name)
        if counts != self._counts:
            self._counts, self._new_until = counts, now + DISCOVERY_TIME
        if self._new_until <= now < self._all_due:
            return False
        self._all_due = now + ALL_PATCHES_PERIOD
        return True


class LatchedOutput:
    """An output that is published when it has changed, from its first subscriber on: the message that a later one gets
    is never old. ``read``: returns what the message depends on; ``make``: returns the message of that."""

    def __init__(
        self, session: Session, kind: Any, topic: str, read: Callable[[], Any], make: Callable[[Any], Any]
    ) -> None:
        self._session, self._read, self._make = session, read, make
        self.publisher = session.publisher(kind, topic, LATCHED)
        self._sent: Any = None  # what the last message was made of; None = no subscribers so far
        self._rhythm = Rhythm()

    def publish(self) -> None:
        if not self._rhythm.is_due(self._session.clock.steady(), LATCHED_RATE):
            return
        if self._sent is None and not self.publisher.get_subscription_count():
            return
        if (found := self._read()) != self._sent:
            self.publisher.publish(self._make(found))
            self._sent = found
