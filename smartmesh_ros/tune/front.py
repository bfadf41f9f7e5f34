"""Points of cost and accuracy: which of them nothing beats, and which one keeps what is asked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from smartmesh_ros.tune.figures import Asked, Figures, Limits

# Penetrations this close together are the same, and the cheaper one is better.
SAME_PENETRATION = 1.05


@dataclass(frozen=True)
class Point:
    """Searched values and what was measured of them; ``name``: of a preset and the like."""

    values: Mapping[str, Any]
    figures: Figures
    name: str = field(default="")


def front(points: Iterable[Point], limits: Limits) -> list[Point]:
    """The points, of those that keep the limits of all but cost and penetration, than which none is both cheaper and
    truer; by cost."""
    beside = Limits(longest=limits.longest, hover=limits.hover, deviation=limits.deviation, failed=limits.failed)
    able = [point for point in points if math.isfinite(point.figures.error) and not beside.excess(point.figures)]
    found: list[Point] = []
    for point in sorted(able, key=lambda point: (point.figures.cost, point.figures.error)):
        if not found or point.figures.error < found[-1].figures.error:
            found.append(point)
    return found


def ranked(points: Iterable[Point], asked: Asked, limits: Limits) -> list[Point]:
    """The points that keep every limit, the best first: the cheapest where a penetration is asked for or nothing is,
    the truest where only a budget or a deadline is."""
    kept = [point for point in points if not limits.excess(point.figures)]
    truest = asked.penetration is None and (asked.budget is not None or asked.deadline is not None)
    if not truest:
        return sorted(kept, key=lambda point: (point.figures.cost, point.figures.error))

    def by_truth(point: Point) -> tuple[float, float]:
        return math.floor(math.log(point.figures.error) / math.log(SAME_PENETRATION)), point.figures.cost

    return sorted(kept, key=by_truth)


def nearest(points: Sequence[Point], limits: Limits) -> Point:
    """The point that passes its worst limit by the least, and of equals the cheapest."""

    def worst(point: Point) -> tuple[float, float]:
        return max(limits.excess(point.figures).values(), default=0.0), point.figures.cost

    return min(points, key=worst)


def hypervolume(points: Iterable[Point], corner: tuple[float, float]) -> float:
    """The area, on logarithmic axes, between the points and a ``corner`` of (cost, penetration) that is worse."""
    area, height = 0.0, math.log(corner[1])
    for point in front(points, Limits(failed=10**9)):
        cost, error = point.figures.cost, point.figures.error
        if cost < corner[0] and math.log(error) < height:
            area += (math.log(corner[0]) - math.log(cost)) * (height - math.log(error))
            height = math.log(error)
    return area
