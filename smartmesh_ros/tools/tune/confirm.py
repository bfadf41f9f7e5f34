"""The confirming run, longer than the search: the best candidates, the defaults, the user's settings and the
presets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.tools.evaluation.presets import NAMES as PRESETS
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.choice import Point, nearest, ranked
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits
from smartmesh_ros.tools.tune.measuring import Say, measure, run
from smartmesh_ros.tools.tune.search import Search
from smartmesh_ros.tools.tune.start import preset_values, settings_of

# Prefixes of the preset parameters that affect the core.
OF_THE_CORE = ("physics.", "patch.", "terrain.motion", "terrain.changes", "terrain.noise", "terrain.settle")


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

    @property
    def on_front(self) -> bool:
        """True if the defaults are chosen, because no point is better."""
        return self.chosen is self.confirmed[-1]


def confirm(search: Search, say: Say) -> Verdict:
    """Run the best points for longer, in turns with the defaults, and choose one by these figures."""
    case, asked = search.case, search.asked
    candidates = _candidates(search.points(), asked, search.limits)
    beside = _beside(case.start)
    values = [{**case.start, **space.defaults()}, *beside.values()]
    values += [{**case.start, **point.values} for point in candidates]
    runners = run(
        case, [settings_of(one) for one in values], case.span.confirm, repeats=CONFIRMING.repeats,
        say=lambda text: say(f"the confirming run {text}"),
    )  # fmt: skip
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
    found: dict[str, dict[str, Any]] = {}
    if any(start.get(name, value) != value for name, value in space.defaults().items()):
        found["as given"] = dict(start)
    for name in PRESETS:
        ours = {key: value for key, value in preset_values(name).items() if key.startswith(OF_THE_CORE)}
        found[f"preset {name}"] = {**start, **space.defaults(), **ours}
    return found
