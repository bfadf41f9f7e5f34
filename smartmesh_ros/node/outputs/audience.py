"""Who has received what of an output."""

from __future__ import annotations

import math
from collections.abc import Callable

# Longest time between two messages with all patches in incremental mode [s].
ALL_PATCHES_PERIOD = 5.0
# Time in which a new subscriber may not have discovered the node and so misses messages [s].
DISCOVERY_TIME = 3.0


class Audience:
    """Subscribers and publishers of an output. ``new``: True if some may have missed messages, or another publisher may
    have made subscribers forget some. ``now``: a clock [s]."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._counts = (0, 0)
        self._new_until = -math.inf
        self._all_due = -math.inf

    def count(self, subscribers: int, publishers: int) -> None:
        """Note the numbers of subscribers and publishers."""
        if (subscribers, publishers) != self._counts:
            self._counts, self._new_until = (subscribers, publishers), self._now() + DISCOVERY_TIME

    @property
    def new(self) -> bool:
        """True if some may have missed messages."""
        return self._now() < self._new_until

    def needs_all(self) -> bool:
        """Return False if the next message may contain only changes. New subscribers, and every `ALL_PATCHES_PERIOD`
        all subscribers, receive everything."""
        now = self._now()
        if self._new_until <= now < self._all_due:
            return False
        self._all_due = now + ALL_PATCHES_PERIOD
        return True

    def missed(self) -> None:
        """Note that the last message was not sent: the next one has everything."""
        self._all_due = -math.inf
