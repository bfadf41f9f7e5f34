"""The Pareto front of a chart, and comparisons with it.

A result is accurate if bodies are near the ground while something holds them up, and where they belong: penetration
alone would reward leaving the ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from studies.contest import Result

# Distances and deviations below this count as none [m]. Bodies at rest in PyBullet overlap by half of it.
FLOOR = 2e-5

Measure = Literal["distance", "deviation"]


def distance_of(result: Result) -> float:
    """Return the distance from the ground [m] of bodies that something holds up: the larger of penetration and hover,
    99 %; infinite where bodies are lost or none was measured."""
    if result.lost or math.isnan(result.p99):
        return math.inf
    return max(result.p99, 0.0 if math.isnan(result.hover) else result.hover, FLOOR)


def deviation_of(result: Result) -> float:
    """Return the deviation from the reference after a second [m], median over the bodies; infinite where bodies are
    lost or it was not measured."""
    return math.inf if result.lost or math.isnan(result.deviation) else max(result.deviation, FLOOR)


MEASURES: dict[Measure, Callable[[Result], float]] = {"distance": distance_of, "deviation": deviation_of}


def measures_of(results: Mapping[str, Result]) -> tuple[Measure, ...]:
    """Return the measures of a scene; without a reference there is no deviation."""
    has_reference = any(not math.isnan(result.deviation) for result in results.values())
    return ("distance", "deviation") if has_reference else ("distance",)


def pareto_front(results: Mapping[str, Result], measures: tuple[Measure, ...] | None = None) -> list[str]:
    """Return the names of the results that no other one beats in cost and all ``measures`` (None = the scene's), sorted
    by cost, without results that lost bodies."""
    chosen = measures_of(results) if measures is None else measures
    points = {
        name: (result.cost, *(MEASURES[measure](result) for measure in chosen))
        for name, result in results.items()
        if result.cost > 0.0 and math.isfinite(distance_of(result))
    }
    front = [
        name
        for name, point in points.items()
        if not any(other != point and all(np.less_equal(other, point)) for other in points.values())
    ]
    return sorted(front, key=lambda name: points[name])


def only_by(results: Mapping[str, Result]) -> dict[str, str]:
    """Return for each result on the front by which measure alone it is there: the one whose own front over cost and
    that measure has it; empty if both have, or there is one measure; "both together" if neither has."""
    measures = measures_of(results)
    fronts = {measure: pareto_front(results, (measure,)) for measure in measures}
    found: dict[str, str] = {}
    for name in pareto_front(results):
        by = [measure for measure in measures if name in fronts[measure]]
        found[name] = "" if len(by) == len(measures) else (by[0] if by else "both together")
    return found


def beyond_all(ours: Mapping[str, Result], rivals: Mapping[str, Result]) -> list[str]:
    """Return rivals that are both faster and more accurate than all of our results: in the distance from the ground
    and, if it was measured, in the deviation from the reference."""
    return [
        name
        for name, rival in rivals.items()
        if math.isfinite(distance_of(rival))
        and all(
            rival.cost < own.cost and distance_of(rival) < distance_of(own) and not rival.deviation > own.deviation
            for own in ours.values()
        )
    ]


def cheapest_as_accurate(
    results: Mapping[str, Result], distance: float = math.inf, deviation: float = math.inf
) -> str | None:
    """Return the cheapest of the results that are at most so far from the ground and from the reference [m] and lost no
    bodies, None = there is none."""
    good = [
        (result.cost, name)
        for name, result in results.items()
        if result.cost > 0.0
        and math.isfinite(distance_of(result))
        and distance_of(result) <= distance
        and deviation_of(result) <= deviation
    ]
    return min(good)[1] if good else None
