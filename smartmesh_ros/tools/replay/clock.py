"""The time of a replay."""

from __future__ import annotations

from collections.abc import Callable


class ReplayClock:
    """A `Clock` that advances only when it is told to.

    ``elapsed`` [s]: time since the start of the replay on the recorder's clock. ``start`` [s]: the recorder's time at
    the start. ``simulated``: the time of stamps and steps is that of ``/clock`` instead, 0 before its first message.
    """

    def __init__(self, start: float, *, simulated: bool) -> None:
        self.start, self.simulated, self.elapsed = start, simulated, 0.0
        self._simulated_now = 0.0
        self._acts: list[Callable[[], None]] = []

    def steady(self) -> float:
        """Return the time for measurements and periods of outputs [s]."""
        return self.elapsed

    def pace(self) -> float:
        """Return the time for deadlines, intervals and time-outs [s]."""
        return self._simulated_now if self.simulated else self.elapsed

    def stamp_now(self) -> float:
        """Return the time that stamps are compared with [s]."""
        return self._simulated_now if self.simulated else self.start + self.elapsed

    def on_set_back(self, act: Callable[[], None]) -> None:
        """Call ``act`` whenever ``/clock`` jumps back."""
        self._acts.append(act)

    def set_simulated(self, now: float) -> None:
        """Take the time of a message on ``/clock`` [s]."""
        before, self._simulated_now = self._simulated_now, now
        if now < before:
            for act in self._acts:
                act()
