"""The choice among measured settings: the best within limits, or the nearest to them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits

# Penetrations within this factor count as equal; the cheaper point is then better.
SAME_PENETRATION = 1.05


@dataclass(frozen=True)
class Point:
    """Values of the searched parameters, and their figures."""

    values: Mapping[str, Any]
    figures: Figures


def ranked(points: Iterable[Point], asked: Asked, limits: Limits) -> list[Point]:
    """Return the points within all limits, the best first.

    If only a budget or a deadline is given, the best is the one with the least penetration, otherwise the cheapest.
    """
    kept = [point for point in points if not limits.excess(point.figures)]
    truest = asked.penetration is None and (asked.budget is not None or asked.deadline is not None)
    if not truest:
        return sorted(kept, key=lambda point: (point.figures.cost, point.figures.error))

    def by_truth(point: Point) -> tuple[float, float]:
        return math.floor(math.log(point.figures.error) / math.log(SAME_PENETRATION)), point.figures.cost

    return sorted(kept, key=by_truth)


def nearest(points: Sequence[Point], limits: Limits) -> list[Point]:
    """Return the points sorted by their maximum excess over the limits, equals by cost."""

    def worst(point: Point) -> tuple[float, float]:
        return max(limits.excess(point.figures).values(), default=0.0), point.figures.cost

    return sorted(points, key=worst)


def binding(points: Iterable[Point], limits: Limits) -> tuple[str, ...]:
    """Return the smallest set of limits without which one of the points would be within all others; of several such
    sets the one with the smallest excess."""
    exceeded = [limits.excess(point.figures) for point in points]
    least = min(exceeded, key=lambda excess: (len(excess), max(excess.values(), default=0.0)), default={})
    return tuple(least)
