"""Texts of a search: the line of progress, and the report at the end."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import ALLOWANCE, Asked, Figures, Limits
from smartmesh_ros.tools.tune.front import Point, ranked

# Names of the limits, and the options that set them, by field.
NAMES = {
    "cost": "cost", "penetration": "penetration", "longest": "the longest step", "hover": "hover",
    "deviation": "deviation", "failed": "bodies lost or put back",
}  # fmt: skip
OPTIONS = {
    "cost": "budget", "penetration": "penetration", "longest": "deadline", "hover": "hover", "deviation": "deviation",
}  # fmt: skip


def progress(done: int, trials: int, left: float, points: Sequence[Point], asked: Asked, base: Figures) -> str:
    """Return the line of progress; ``left``: estimated remaining time [s]."""
    best = ranked(points, asked, Limits.of(asked, base))
    found = f"best so far {costs(best[0].figures)}" if best else "no settings within the limits yet"
    minutes, seconds = divmod(round(left), 60)
    return f"{done}/{trials} tried, {minutes}:{seconds:02d} left; {found}; defaults {costs(base)}"


def costs(figures: Figures) -> str:
    """Return cost and penetration as a text."""
    return f"{figures.cost:.3f} of a core, {1e3 * figures.penetration:.3g} mm"


def closing_lines(title: str, asked: Asked, verdict: Verdict, points: Sequence[Point], file: str) -> list[str]:
    """Return the lines of the report; ``points``: all tried points."""
    chosen, short, defaults = verdict.chosen.figures, verdict.short, verdict.defaults
    changed = [f"{name} {value}" for name, value in _changes(verdict).items()]
    return [
        f"{title}: {len(points)} settings tried, the best confirmed over {chosen.ran:g} s of simulated time.",
        *_outcome(asked, verdict, points),
        *_better_dots(verdict, points),
        f"Chosen: {chosen.cost:.3f} of a core ({short.cost:.3f} in the search), {1e3 * chosen.penetration:.3g} mm of "
        f"penetration ({1e3 * short.penetration:.3g} mm in the search), longest step {1e3 * chosen.longest:.3g} ms, "
        f"hover {1e3 * chosen.hover:.3g} mm, {chosen.lost} of {chosen.bodies} bodies lost.",
        f"Defaults: {costs(defaults)} of penetration; so it costs {chosen.cost / defaults.cost:.2f} times as much, at "
        f"{chosen.error / defaults.error:.2f} times the penetration.",
        f"Changed: {', '.join(changed) or 'nothing'}. Written to {file}.",
    ]


def binding(found: Iterable[Figures], limits: Limits) -> tuple[str, ...]:
    """Return the smallest set of limits without which one of the settings would be within all others; of several such
    sets the one with the smallest excess."""
    exceeded = [limits.excess(figures) for figures in found]
    least = min(exceeded, key=lambda excess: (len(excess), max(excess.values(), default=0.0)), default={})
    return tuple(least)


def _outcome(asked: Asked, verdict: Verdict, points: Sequence[Point]) -> list[str]:
    if verdict.on_front and verdict.keeps:
        return [f"Asked: {asked.words}. The defaults are on the front: nothing that was found beats them."]
    if verdict.keeps:
        return [f"Asked: {asked.words}. Kept."]
    chosen = verdict.chosen.figures
    passed = "; ".join(
        f"{NAMES[name]} {_amount(name, _value(name, chosen))} (at most {_amount(name, getattr(verdict.limits, name))}"
        f"{_reason(name, asked, verdict.limits)})"
        for name in verdict.limits.excess(chosen)
    )
    lines = [f"Not possible here: {asked.words}. The nearest that was found has {passed}."]
    lines.append(_what_binds(verdict, points))
    able = [name for name, figures in verdict.others.items() if not verdict.limits.excess(figures)]
    if able:
        lines.append(f"It is kept by {' and '.join(able)}, which change more than is searched.")
    return lines


def _what_binds(verdict: Verdict, points: Sequence[Point]) -> str:
    """Return a sentence on the limits that bind: in the search, or in the confirming run if settings of the search were
    within all limits."""
    kept = sum(not verdict.searched.excess(point.figures) for point in points)
    if kept:
        names = binding([point.figures for point in verdict.confirmed], verdict.limits)
        return (
            f"{kept} of {len(points)} settings kept it over the {verdict.short.ran:g} s of the search, none of the "
            f"{len(verdict.confirmed)} confirmed ones over {verdict.chosen.figures.ran:g} s. What binds there is "
            f"{_limits(names)}."
        )
    names = binding([point.figures for point in points], verdict.searched)
    would = [point for point in points if set(verdict.searched.excess(point.figures)) <= set(names)]
    if not would:
        return "No setting was tried."
    best = min(would, key=lambda point: max(verdict.searched.excess(point.figures).values()))
    beside = ", ".join(f"{NAMES[name]} {_amount(name, _value(name, best.figures))}" for name in names)
    return (
        f"What binds is {_limits(names)}: without {'it' if len(names) == 1 else 'them'} {len(would)} of {len(points)} "
        f"settings would do, the nearest with {beside} in the search."
    )


def _better_dots(verdict: Verdict, points: Sequence[Point]) -> list[str]:
    """Return the reasons why dots of the chart that look better than the chosen settings were not chosen."""
    short = verdict.short
    better = [
        point.figures for point in points if point.figures.cost < short.cost and point.figures.error <= short.error
    ]
    broken = Counter(broken_limit(figures, verdict.searched) for figures in better)
    kept = broken.pop("", 0)
    said = [f"{count} {verb(name, count)}" for name, count in broken.items()]
    if not said:
        return []
    others = [f"{kept} did not do as well in the confirming run or were not run again"] if kept else []
    return [
        f"{len(better)} dots are cheaper than the chosen settings without more penetration; {', '.join(said + others)}."
    ]


def broken_limit(figures: Figures, limits: Limits) -> str:
    """Return the limit that a setting exceeds, preferably one that the chart's axes do not show; "" = none."""
    excess = limits.excess(figures)
    return next((name for name in ("failed", "hover", "deviation", "longest", "penetration", "cost") if name in excess),
                "")  # fmt: skip


def verb(name: str, count: int = 1) -> str:
    """Return the predicate of settings that exceed a limit, for a legend or a sentence."""
    if name == "failed":
        return "loses bodies" if count == 1 else "lose bodies"
    return f"break{'s' if count == 1 else ''} the limit of {NAMES[name]}"


def _limits(names: Sequence[str]) -> str:
    return f"the limit{'s' if len(names) > 1 else ''} of {' and '.join(NAMES[name] for name in names)}"


def _value(name: str, figures: Figures) -> float:
    """Return the figure of a setting that belongs to a limit."""
    return figures.lost + figures.rescued if name == "failed" else float(getattr(figures, name))


def _amount(name: str, value: float) -> str:
    """Return a value with its unit."""
    if not math.isfinite(value):
        return "not measured"
    if name == "cost":
        return f"{value:.3g} of a core"
    if name == "failed":
        return f"{value:g}"
    return f"{1e3 * value:.3g} {'ms' if name == 'longest' else 'mm'}"


def _reason(name: str, asked: Asked, limits: Limits) -> str:
    """Return the origin of a limit."""
    option = OPTIONS.get(name)
    if option is not None and getattr(asked, option) is not None:
        return ", as asked"
    if name not in ("hover", "deviation"):
        return ", as the defaults"
    least = getattr(ALLOWANCE, name)
    times = "twice" if ALLOWANCE.factor == 2.0 else f"{ALLOWANCE.factor:g} times"
    share = "always allowed" if getattr(limits, name) == least else f"{times} the defaults'"
    return f": {share}, as --{option} is not given"


def _changes(verdict: Verdict) -> dict[str, object]:
    from smartmesh_ros.tools.tune.space import defaults

    known = defaults()
    return {name: value for name, value in verdict.chosen.values.items() if known[name] != value}
