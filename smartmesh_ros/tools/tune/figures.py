"""Figures of cost and accuracy, and limits on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.errors import InputError

# Penetration below this counts as none [m]. Bodies at rest in PyBullet overlap by half of it.
FLOOR = 2e-5


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of one setting in one case.

    ``cost``: processor time of messages and steps per simulated second [s], which is the share of a core in real time.
    ``longest``: processor time of the longest step with the messages before it [s]. ``penetration`` and ``hover``: 99th
    percentiles [m], defined as in the accuracy study. ``deviation``: median distance of the bodies from a run at small
    steps [m], NaN = unknown. ``lost``: number of bodies whose centre was below the ground or that left the world.
    ``rescued``: how often bodies were lifted back onto the ground.
    """

    cost: float = math.nan
    longest: float = math.nan
    penetration: float = math.nan
    hover: float = math.nan
    deviation: float = math.nan
    lost: int = 0
    rescued: int = 0

    @property
    def failed(self) -> int:
        """Number of lost bodies and rescues."""
        return self.lost + self.rescued

    @property
    def error(self) -> float:
        """Penetration for the chart [m], at least `FLOOR`; infinite if it was not measured."""
        return math.inf if math.isnan(self.penetration) else max(self.penetration, FLOOR)


def require_positive(option: str, value: float | None) -> None:
    """Raise `InputError` if the value of an option is given, and is no number greater than zero."""
    if value is not None and not 0.0 < value < math.inf:
        raise InputError("parameter", f"--{option} is {value:g}; it must be a number greater than zero")


@dataclass(frozen=True, kw_only=True)
class Allowance:
    """Limits of hover and deviation: ``factor`` times the figure of the defaults, but at least ``hover`` and
    ``deviation`` [m]. The factor lets the rate of steps be halved, which doubles the deviation from the truth, and
    makes that from a run at an eighth of the default's step 15/7 times as large."""

    factor: float = 2.5
    hover: float = 5e-4
    deviation: float = 5e-3


ALLOWANCE = Allowance()


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Maximum of each figure; infinite = no limit. ``failed``: lost and rescued bodies together. ``asked``: the figures
    whose limits the user gave."""

    cost: float = math.inf
    penetration: float = math.inf
    longest: float = math.inf
    hover: float = math.inf
    deviation: float = math.inf
    failed: int = 0
    asked: frozenset[str] = frozenset()

    @classmethod
    def of(cls, asked: Mapping[str, float], defaults: Figures) -> Limits:
        """Return the user's limits by figure, and limits derived from the defaults' figures where the user gives
        none."""
        return cls(
            **(asked or {"penetration": defaults.error}),
            hover=max(ALLOWANCE.hover, ALLOWANCE.factor * defaults.hover),
            deviation=max(ALLOWANCE.deviation, ALLOWANCE.factor * defaults.deviation),
            failed=defaults.failed,
            asked=frozenset(asked),
        )

    def excess(self, figures: Figures) -> dict[str, float]:
        """Return the relative excess (figure / limit - 1) over each exceeded limit, by name."""
        found = {
            "failed": (1.0 + figures.failed) / (1.0 + self.failed),
            "hover": figures.hover / self.hover,
            "deviation": 0.0 if math.isnan(figures.deviation) else figures.deviation / self.deviation,
            "longest": figures.longest / self.longest,
            "penetration": figures.error / self.penetration,  # not a number if neither is finite
            "cost": figures.cost / self.cost,
        }
        return {name: ratio - 1.0 if ratio > 1.0 else math.inf for name, ratio in found.items() if not ratio <= 1.0}


@dataclass(frozen=True)
class Point:
    """Values of the parameters of the grid, and their figures."""

    values: Mapping[str, Any]
    figures: Figures
