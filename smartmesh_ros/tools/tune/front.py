"""Points of cost and accuracy: the Pareto front, and the best point within limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits

# Penetrations within this factor count as equal; the cheaper point is then better.
SAME_PENETRATION = 1.05


@dataclass(frozen=True)
class Point:
    """Values of the searched parameters and their figures; ``name``: of a preset or of the defaults."""

    values: Mapping[str, Any]
    figures: Figures
    name: str = field(default="")


def front(points: Iterable[Point], limits: Limits) -> list[Point]:
    """Return the Pareto front of cost and penetration, sorted by cost, among points within all other limits."""
    beside = Limits(longest=limits.longest, hover=limits.hover, deviation=limits.deviation, failed=limits.failed)
    able = [point for point in points if math.isfinite(point.figures.error) and not beside.excess(point.figures)]
    found: list[Point] = []
    for point in sorted(able, key=lambda point: (point.figures.cost, point.figures.error)):
        if not found or point.figures.error < found[-1].figures.error:
            found.append(point)
    return found


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


def nearest(points: Sequence[Point], limits: Limits) -> Point:
    """Return the point with the smallest maximum excess over its limits; of equals the cheapest."""

    def worst(point: Point) -> tuple[float, float]:
        return max(limits.excess(point.figures).values(), default=0.0), point.figures.cost

    return min(points, key=worst)


def hypervolume(points: Iterable[Point], corner: tuple[float, float]) -> float:
    """Return the area, on logarithmic axes, between the front of the points and a worse ``corner`` (cost,
    penetration)."""
    area, height = 0.0, math.log(corner[1])
    for point in front(points, Limits(failed=10**9)):
        cost, error = point.figures.cost, point.figures.error
        if cost < corner[0] and math.log(error) < height:
            area += (math.log(corner[0]) - math.log(cost)) * (height - math.log(error))
            height = math.log(error)
    return area
