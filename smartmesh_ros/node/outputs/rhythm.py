"""When outputs are due, by rates that may change."""

from __future__ import annotations


class Rhythm:
    """The times at which one output is due. ``first``: the first of them [s]."""

    def __init__(self, first: float = 0.0) -> None:
        self._due = first

    def is_due(self, time: float, rate: float, *, now: bool = False) -> bool:
        """Return True at a ``time`` [s] if the output of a ``rate`` [Hz] is due, or is to be ``now``; then the next one
        is due a period later. A late or an early message does not shift the phase, unless a whole period was missed."""
        period = 1.0 / rate
        self._due = min(self._due, time + period)  # the rate was lower before
        if not now and time < self._due:
            return False
        self._due = max(min(self._due, time) + period, time)
        return True
