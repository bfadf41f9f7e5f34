"""A trot of laikago as a table of joint positions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from studies.robots.robot import LAIKAGO_KNEE, LEGS, laikago_joints

# Phase of each leg as a share of the period [-]: the legs of a diagonal swing together.
PHASES = {"FR": 0.0, "RL": 0.0, "FL": 0.5, "RR": 0.5}


@dataclass(frozen=True, kw_only=True)
class Trot:
    """``period`` [s]: of a step of each leg. ``swing`` [rad]: of the hips, forwards and backwards. ``lift`` [rad]: of
    the knees while their leg swings forwards. ``rate`` [Hz]: of the table's rows."""

    period: float = 0.4
    swing: float = 0.12
    lift: float = 0.35
    rate: float = 60.0

    @property
    def table(self) -> list[Mapping[str, float]]:
        """Return the joint positions [rad] of one period, a row for each instant of the table."""
        rows = round(self.period * self.rate)
        return [self._positions(row / rows) for row in range(rows)]

    def _positions(self, share: float) -> Mapping[str, float]:
        """Return the positions at a share of the period [-]: a leg swings forwards in the first half of its period, its
        knee bent, and pushes the ground backwards in the second."""
        found = {}
        for leg in LEGS:
            angle = 2.0 * math.pi * (share + PHASES[leg])
            abduction, hip, knee = laikago_joints(leg)
            found[abduction] = 0.0
            found[hip] = self.swing * math.cos(angle)
            found[knee] = LAIKAGO_KNEE - self.lift * max(math.sin(angle), 0.0)
        return found
