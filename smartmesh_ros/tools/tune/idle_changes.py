"""Reverts parameter changes without effect on the case, because they may have an effect on other ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.front import Point
from smartmesh_ros.tools.tune.measuring import run
from smartmesh_ros.tools.tune.start import settings_of

# Costs within this factor count as equal.
SAME_COST = 1.03


def without_idle_changes(case: Case, points: Sequence[Point], reference: Mapping[str, Any] | None) -> list[Point]:
    """Return the points with parameters at their defaults where that changes no figure of accuracy and costs no
    more."""
    return [_without_idle_changes(case, point, reference) for point in points]


def _without_idle_changes(case: Case, point: Point, reference: Mapping[str, Any] | None) -> Point:
    known = space.defaults()
    changed = [name for name, value in point.values.items() if value != known[name]]
    if not changed:
        return point
    variants = [dict(point.values), *({**point.values, name: known[name]} for name in changed)]
    settings = [settings_of({**case.start, **values}) for values in variants]
    own, *found = run(case, settings, case.span.search, reference)
    idle = [name for name, figures in zip(changed, found, strict=True) if _same(own, figures)]
    return Point({**point.values, **{name: known[name] for name in idle}}, point.figures)


def _same(own: Figures, other: Figures) -> bool:
    """Return True if ``other`` has exactly the same accuracy and costs no more."""

    def ways(figures: Figures) -> tuple[str, ...]:
        return tuple(repr(value) for value in (figures.penetration, figures.hover, figures.deviation, figures.lost))

    return ways(own) == ways(other) and other.cost <= SAME_COST * own.cost
