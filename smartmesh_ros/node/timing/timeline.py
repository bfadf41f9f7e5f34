"""Simulated time against the clock, for a loop that cannot keep its period."""

from __future__ import annotations

import numpy as np

# Length of the window of last steps, an even number.
LENGTH = 32
# A loop is overloaded if both halves of the window took longer than this many periods per step. Both, because a single
# long step slows only one half.
OVERLOAD = 1.02


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
        """Forgets all steps."""
        self._count = 0

    def note(self, start: float) -> None:
        """Records a step that starts at ``start`` [s]."""
        self._starts[:-1] = self._starts[1:]
        self._starts[-1] = start
        self._count += 1

    def overloaded(self, period: float) -> bool:
        """Return True if the loop cannot keep this ``period`` [s]."""
        if self._count < LENGTH:
            return False
        first, middle, last = self._starts[[0, LENGTH // 2, -1]].tolist()
        most = OVERLOAD * period
        slow = middle - first > most * (LENGTH // 2), last - middle > most * (LENGTH // 2 - 1)
        return all(slow)

    def steps_to(self, instant: float) -> float:
        """Return the simulated time at ``instant`` [s], in steps after the next step (negative before it).

        A least-squares line through the starts gives the time.
        """
        middle = self._starts.mean()
        offsets = self._starts - middle
        rate = (offsets @ self._steps) / (offsets @ offsets)
        return float(rate * (instant - middle) - 0.5 * (LENGTH + 1))
