"""The confirming run, longer than the search: the best candidates, the defaults, the user's settings and the
presets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.tools.evaluation.presets import NAMES as PRESETS
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Asked, Figures, Limits
from smartmesh_ros.tools.tune.front import Point, nearest, ranked
from smartmesh_ros.tools.tune.idle_changes import without_idle_changes
from smartmesh_ros.tools.tune.measuring import run
from smartmesh_ros.tools.tune.start import preset_file, read_parameters, settings_of

# Prefixes of the preset parameters that affect the core.
OF_THE_CORE = ("physics.", "patch.", "terrain.motion", "terrain.changes", "terrain.noise", "terrain.settle")


@dataclass(frozen=True, kw_only=True)
class Confirming:
    """``candidates``: number of points that run again. For each fraction in ``tightened`` the best point within that
    fraction of the limits is among them. ``repeats``: number of times that every step is timed."""

    candidates: int = 6
    tightened: tuple[float, ...] = (0.8, 0.6, 0.4)
    repeats: int = 3


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Result of the confirming run.

    ``chosen``: the point of the written file. ``keeps``: True if the point meets all limits, False if it is only the
    nearest. ``on_front``: True if the defaults are chosen because no point is better. ``others``: figures of presets
    and of the user's settings, by name. ``limits``: limits in the confirming run. ``searched``: limits in the search,
    which differ because the defaults' figures differ. ``short``: figures of the chosen point in the search.
    ``confirmed``: all points that ran again, the defaults last.
    """

    chosen: Point
    keeps: bool
    on_front: bool
    defaults: Figures
    others: Mapping[str, Figures]
    limits: Limits
    searched: Limits
    short: Figures
    confirmed: Sequence[Point] = ()


def confirm(
    case: Case,
    points: Sequence[Point],
    asked: Asked,
    base: Figures,
    reference: Mapping[str, Any] | None,
    plan: Confirming,
    say: Callable[[str], None],
) -> Verdict:
    """Run the best points for longer, in turns with the defaults, and choose one by these figures."""
    candidates = _candidates(points, asked, Limits.of(asked, base), plan)
    say("changes of the best settings without effect")
    candidates = _distinct(without_idle_changes(case, candidates, reference))
    beside = _beside(case.start)
    all_values = [{**case.start, **space.defaults()}, *beside.values()]
    all_values += [{**case.start, **point.values} for point in candidates]
    found = run(case, [settings_of(values) for values in all_values], case.span.confirm, reference,
                repeats=plan.repeats, say=lambda text: say(f"the confirming run {text}"))  # fmt: skip
    defaults, others = found[0], dict(zip(beside, found[1:], strict=False))
    limits = Limits.of(asked, defaults)
    again = [Point(point.values, figures) for point, figures in zip(candidates, found[1 + len(beside) :], strict=True)]
    own = Point(space.defaults(), defaults, "defaults")
    kept = ranked([*again, own], asked, limits)
    chosen = kept[0] if kept else nearest([*again, own], limits)
    short = base if chosen is own else candidates[again.index(chosen)].figures
    return Verdict(
        chosen=chosen, keeps=bool(kept), on_front=chosen is own, defaults=defaults, others=others, limits=limits,
        searched=Limits.of(asked, base), short=short, confirmed=(*again, own),
    )  # fmt: skip


def _candidates(points: Sequence[Point], asked: Asked, limits: Limits, plan: Confirming) -> list[Point]:
    """Return the best points, the best within tightened limits, and then those that exceed their limits least.

    Points with a margin are included because figures may rise in the longer run. The defaults are left out, because
    they are measured anyway.
    """
    able = [point for point in points if dict(point.values) != space.defaults()]
    found = ranked(able, asked, limits)[:2]
    for share in plan.tightened:
        found += ranked(able, asked, limits.tightened(share))[:1]
    spare = sorted(able, key=lambda point: max(limits.excess(point.figures).values(), default=0.0))
    return _distinct([*found, *ranked(able, asked, limits), *spare])[: plan.candidates]


def _distinct(points: Sequence[Point]) -> list[Point]:
    found: dict[tuple[Any, ...], Point] = {}
    for point in points:
        found.setdefault(tuple(point.values.values()), point)
    return list(found.values())


def _beside(start: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the user's settings, if they differ from the defaults, and the settings of each preset."""
    found: dict[str, dict[str, Any]] = {}
    if any(start.get(name, value) != value for name, value in space.defaults().items()):
        found["as given"] = dict(start)
    for name in PRESETS:
        preset = read_parameters(preset_file(name))
        ours = {key: value for key, value in preset.items() if key.startswith(OF_THE_CORE)}
        found[f"preset {name}"] = {**start, **space.defaults(), **ours}
    return found
