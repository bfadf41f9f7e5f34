"""Figures of cost and accuracy, limits on them, and the choice among them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

# Penetration below this counts as none [m]. Bodies at rest in PyBullet overlap by half of it.
FLOOR = 2e-5
# Penetrations within this factor count as equal; the cheaper point is then better.
SAME_PENETRATION = 1.05
# Limits of hover and deviation: so many times the figure of the defaults, but at least these [m]. The factor lets the
# rate of steps be halved, which doubles the deviation from the truth, and makes that from a run at an eighth of the
# default's step 15/7 times as large.
FACTOR, LEAST = 2.5, {"hover": 5e-4, "deviation": 5e-3}


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of one setting in one case.

    ``values``: of the parameters of the grid. ``cost``: processor time of messages and steps per simulated second [s],
    which is the share of a core in real time. ``longest``: processor time of the longest step with the messages before
    it [s]. ``penetration`` and ``hover``: 99th percentiles [m], defined as in the accuracy study. ``deviation``: median
    distance of the bodies from a run at small steps [m], NaN = unknown. ``failed``: number of bodies whose centre was
    below the ground or that left the world, and how often bodies were lifted back onto the ground.
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    cost: float = math.nan
    longest: float = math.nan
    penetration: float = math.nan
    hover: float = math.nan
    deviation: float = math.nan
    failed: int = 0

    @property
    def error(self) -> float:
        """Penetration for the chart [m], at least `FLOOR`; infinite if it was not measured."""
        return math.inf if math.isnan(self.penetration) else max(self.penetration, FLOOR)


def limits_of(asked: Mapping[str, float], defaults: Figures) -> dict[str, float]:
    """Return the maximum of each figure: those that were ``asked`` for, and limits derived from the defaults' figures;
    infinite = no limit."""
    free = {"failed": defaults.failed, "longest": math.inf, "penetration": math.inf, "cost": math.inf}
    derived = {name: max(least, FACTOR * getattr(defaults, name)) for name, least in LEAST.items()}
    return {**free, **derived, **(asked or {"penetration": defaults.error})}


def excess(figures: Figures, limits: Mapping[str, float]) -> dict[str, float]:
    """Return the relative excess (figure / limit - 1) over each exceeded limit, by name."""
    found = {
        "failed": (1.0 + figures.failed) / (1.0 + limits["failed"]),
        "hover": figures.hover / limits["hover"],
        "deviation": 0.0 if math.isnan(figures.deviation) else figures.deviation / limits["deviation"],
        "longest": figures.longest / limits["longest"],
        "penetration": figures.error / limits["penetration"],  # not a number if neither is finite
        "cost": figures.cost / limits["cost"],
    }
    return {name: ratio - 1.0 if ratio > 1.0 else math.inf for name, ratio in found.items() if not ratio <= 1.0}


def best(points: Iterable[Figures], asked: Mapping[str, float], limits: Mapping[str, float]) -> Figures:
    """Return the best point within all limits, or else that with the least maximum excess.

    If only a budget or a deadline is asked for, the best is the one with the least penetration, otherwise the cheapest.
    """
    truest = asked and "penetration" not in asked

    def order(point: Figures) -> tuple[float, ...]:
        most = max(excess(point, limits).values(), default=0.0)
        error = math.log(point.error) // math.log(SAME_PENETRATION)
        return (most, error, point.cost) if truest else (most, point.cost, point.error)

    return min(points, key=order)


def front(points: Iterable[Figures]) -> list[Figures]:
    """Return the points that no other beats in both cost and penetration, by cost."""
    found: list[Figures] = []
    for point in sorted(points, key=lambda point: (point.cost, point.error)):
        if math.isfinite(point.error) and (not found or point.error < found[-1].error):
            found.append(point)
    return found


def binding(points: Iterable[Figures], limits: Mapping[str, float]) -> tuple[str, ...]:
    """Return the smallest set of limits without which one of the points would be within all others; of several such
    sets the one with the smallest excess."""
    exceeded = [excess(point, limits) for point in points]
    least: Mapping[str, float] = min(exceeded, key=lambda over: (len(over), max(over.values(), default=0.0)))
    return tuple(least)
