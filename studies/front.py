"""The Pareto front of a chart, and comparisons with it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from studies.contest import Result

# Penetration below this counts as none [m]. Bodies at rest in PyBullet overlap by half of it.
FLOOR = 2e-5


def error_of(result: Result) -> float:
    """The chart's measure of accuracy [m]: penetration, 99 %; infinite where bodies are lost or none was measured."""
    if result.lost or math.isnan(result.p99):
        return math.inf
    return max(result.p99, FLOOR)


def pareto_front(results: Mapping[str, Result]) -> list[str]:
    """Return the names of the results on the Pareto front of cost and accuracy, sorted by cost, without results that
    lost bodies."""
    order = sorted((result.cost, error_of(result), name) for name, result in results.items() if result.cost > 0.0)
    front = []
    least = math.inf
    for _, error, name in order:
        if error < least:
            front.append(name)
            least = error
    return front


def beyond_all(ours: Mapping[str, Result], rivals: Mapping[str, Result], *, trajectory: bool) -> list[str]:
    """Return rivals that are both faster and more accurate than all of our results: in penetration and, with
    ``trajectory``, in the deviation from the reference, if it was measured."""
    return [
        name
        for name, rival in rivals.items()
        if math.isfinite(error_of(rival))
        and all(
            rival.cost < own.cost
            and error_of(rival) < error_of(own)
            and not (trajectory and rival.deviation > own.deviation)
            for own in ours.values()
        )
    ]


def cheapest_as_accurate(results: Mapping[str, Result], error: float) -> str | None:
    """The cheapest of the results whose error is at most ``error`` [m], None = there is none."""
    good = [(result.cost, name) for name, result in results.items() if error_of(result) <= error and result.cost > 0.0]
    return min(good)[1] if good else None
