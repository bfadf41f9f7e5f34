"""When outputs are due, by rates that may change."""

from __future__ import annotations

from smartmesh_ros.world.world import World


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


class Beat:
    """The steps of a world in which an output of a ``rate`` in simulated time [Hz] is due."""

    def __init__(self, world: World, rate: float) -> None:
        self._world, self._rate, self._turn = world, rate, -1

    def is_due(self, *, now: bool) -> bool:
        """Return True once for each period, and if it is to be ``now``."""
        turn = self._world.periods(self._rate)
        due, self._turn = now or turn != self._turn, turn
        return due
