"""The confirming run, longer than the search: the best candidates, the defaults, the user's settings and the presets;
and the choice among them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits, Point
from smartmesh_ros.tools.tune.measuring import measure, run
from smartmesh_ros.tools.tune.search import Search
from smartmesh_ros.tools.tune.start import PRESETS, preset_values, settings_of

# Penetrations within this factor count as equal; the cheaper point is then better.
SAME_PENETRATION = 1.05


@dataclass(frozen=True, kw_only=True)
class Confirming:
    """``candidates``: number of points that run again. For each fraction in ``tightened`` the best point within that
    fraction of the limits is among them. ``repeats``: number of times that every step is timed."""

    candidates: int = 6
    tightened: tuple[float, ...] = (0.8, 0.6, 0.4)
    repeats: int = 3


CONFIRMING = Confirming()


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Result of the confirming run.

    ``chosen``: the point of the written file. ``keeps``: True if the point meets all limits, False if it is only the
    nearest. ``limits``: limits in the confirming run. ``short``: figures of the chosen point in the search.
    ``others``: figures of presets and of the user's settings, by name. ``confirmed``: all points that ran again, the
    defaults last.
    """

    chosen: Point
    keeps: bool
    limits: Limits
    short: Figures
    others: Mapping[str, Figures]
    confirmed: Sequence[Point]

    @property
    def defaults(self) -> Figures:
        """Figures of the defaults."""
        return self.confirmed[-1].figures


def confirm(search: Search) -> Verdict:
    """Run the best points for longer, in turns with the defaults, and choose one by these figures."""
    case, asked = search.case, search.asked
    candidates = _candidates(search.points(), asked, search.limits)
    beside = _beside(case.start)
    values = [{**case.start, **space.defaults()}, *beside.values()]
    values += [{**case.start, **point.values} for point in candidates]
    runners = run(case, [settings_of(one) for one in values], case.span.confirm, CONFIRMING.repeats)
    defaults, *found = measure(case, runners, search.reference)
    again = [Point(point.values, new) for point, new in zip(candidates, found[len(beside) :], strict=True)]
    limits, confirmed = Limits.of(asked, defaults), [*again, Point(space.defaults(), defaults)]
    kept = ranked(confirmed, asked, limits)
    chosen = [*kept, *nearest(confirmed, limits)][0]
    short = [*(point.figures for point in candidates), search.base][confirmed.index(chosen)]
    return Verdict(
        chosen=chosen, keeps=bool(kept), limits=limits, short=short, others=dict(zip(beside, found, strict=False)),
        confirmed=confirmed,
    )  # fmt: skip


def _candidates(points: Sequence[Point], asked: Asked, limits: Limits) -> list[Point]:
    """Return the best points, the best within tightened limits, and then those that exceed their limits least.

    Points with a margin are included because figures may rise in the longer run. The defaults are left out, because
    they are measured anyway.
    """
    able = [point for point in points if point.values != space.defaults()]
    found = ranked(able, asked, limits)[:2]
    for share in CONFIRMING.tightened:
        found += ranked(able, asked, limits.tightened(share))[:1]
    distinct: dict[tuple[Any, ...], Point] = {}
    for point in [*found, *ranked(able, asked, limits), *nearest(able, limits)]:
        distinct.setdefault(tuple(point.values.values()), point)
    return list(distinct.values())[: CONFIRMING.candidates]


def _beside(start: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the user's settings, if they differ from the defaults, and the settings of each preset."""
    differs = any(start.get(name, value) != value for name, value in space.defaults().items())
    presets = {f"preset {name}": {**start, **space.defaults(), **preset_values(name)} for name in PRESETS}
    return {"as given": dict(start), **presets} if differs else presets


def ranked(points: Iterable[Point], asked: Asked, limits: Limits) -> list[Point]:
    """Return the points within all limits, the best first.

    If only a budget or a deadline is given, the best is the one with the least penetration, otherwise the cheapest.
    """
    truest = asked.penetration is None and (asked.budget is not None or asked.deadline is not None)

    def order(point: Point) -> tuple[float, float]:
        cost, error = point.figures.cost, point.figures.error
        return (math.log(error) // math.log(SAME_PENETRATION), cost) if truest else (cost, error)

    return sorted((point for point in points if not limits.excess(point.figures)), key=order)


def nearest(points: Iterable[Point], limits: Limits) -> list[Point]:
    """Return the points sorted by their maximum excess over the limits, equals by cost."""
    return sorted(
        points, key=lambda point: (max(limits.excess(point.figures).values(), default=0.0), point.figures.cost)
    )
