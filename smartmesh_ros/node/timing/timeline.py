"""How simulated time has run against the clock, for a loop that cannot keep up."""

from __future__ import annotations

import numpy as np

# Steps that are looked back on, an even number. A loop that takes longer than by so much for both halves of them cannot
# keep up; after a single long step one half is as it should be.
LENGTH, SLOWER = 32, 1.02


class Timeline:
    """The starts of the last steps.

    Steps of a loop that is always late begin when the ones before are done, some of them long and most of them short.
    By each step's own time two maps that came a sixtieth of a second apart would be half or twice as far apart in
    simulated time, and the ground would jolt; by the straight line through the starts they are as far apart as all
    others.
    """

    def __init__(self) -> None:
        self._starts = np.zeros(LENGTH)  # the newest last [s]
        self._steps = np.arange(LENGTH) - 0.5 * (LENGTH - 1)
        self._count = 0

    def clear(self) -> None:
        """Forgets all steps."""
        self._count = 0

    def note(self, start: float) -> None:
        """Adds a step that starts at an instant [s]."""
        self._starts[:-1] = self._starts[1:]
        self._starts[-1] = start
        self._count += 1

    def behind(self, period: float) -> bool:
        """Whether a loop that is to run with this ``period`` [s] cannot keep up."""
        if self._count < LENGTH:
            return False
        first, middle, last = self._starts[[0, LENGTH // 2, -1]].tolist()
        most = SLOWER * period
        slow = middle - first > most * (LENGTH // 2), last - middle > most * (LENGTH // 2 - 1)
        return all(slow)

    def steps_to(self, instant: float) -> float:
        """Steps from the one that comes next to where simulated time was at an instant [s], negative before it: by the
        straight line through the starts, by least squares."""
        middle = self._starts.mean()
        offsets = self._starts - middle
        rate = (offsets @ self._steps) / (offsets @ offsets)
        return float(rate * (instant - middle) - 0.5 * (LENGTH + 1))
