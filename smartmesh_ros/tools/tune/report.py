"""Texts of a search: the line of progress, the report at the end, and the parameter file."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Iterable

import yaml

from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.confirm import Verdict, ranked
from smartmesh_ros.tools.tune.figures import ALLOWANCE, Asked, Limits, Point
from smartmesh_ros.tools.tune.search import Search
from smartmesh_ros.tools.tune.start import DEFAULTS

# Names of the limits, and the options that set them, by the field of `Limits`.
NAMES = {
    "cost": "cost", "penetration": "penetration", "longest": "the longest step", "hover": "hover",
    "deviation": "deviation", "failed": "bodies lost or put back",
}  # fmt: skip
OPTIONS = {
    "cost": "budget", "penetration": "penetration", "longest": "deadline", "hover": "hover", "deviation": "deviation",
}  # fmt: skip


def progress(search: Search, trials: int) -> str:
    """Return the line of progress."""
    points = search.points()
    best = ranked(points, search.asked, search.limits)
    found = f"best so far {best[0].figures.cost:.3f}" if best else "no settings within the limits yet"
    return f"{len(points)}/{trials} tried; {found}; defaults {search.base.cost:.3f} of a core"


def asked_words(asked: Asked) -> str:
    """Return the user's limits as a text."""
    values = {name: getattr(asked, option) for name, option in OPTIONS.items()}
    said = [f"{NAMES[name]} at most {_amount(name, value)}" for name, value in values.items() if value is not None]
    return ", ".join(said) or "no more penetration than the defaults have"


def closing_lines(search: Search, verdict: Verdict) -> list[str]:
    """Return the lines of the report."""
    chosen, defaults = verdict.chosen.figures, verdict.defaults
    changed = [f"{name} {value}" for name, value in space.changes(verdict.chosen.values).items()]
    return [
        table(verdict),
        "",
        f"{search.case.title}: {len(search.points())} settings tried, the best confirmed over "
        f"{search.case.span.confirm:.3g} s of simulated time.",
        *_outcome(search, verdict),
        f"Chosen: {chosen.cost / defaults.cost:.2f} times the cost of the defaults, and "
        f"{chosen.error / defaults.error:.2f} times their penetration.",
        f"Changed: {', '.join(changed) or 'nothing'}.",
    ]


def _outcome(search: Search, verdict: Verdict) -> list[str]:
    """Return whether the limits are met, and if not, which ones are exceeded and which ones bind."""
    if verdict.keeps:
        changed = space.changes(verdict.chosen.values)
        best = "" if changed else " The defaults are on the front: nothing that was found beats them."
        return [f"Asked: {asked_words(search.asked)}. Kept.{best}"]
    exceeded = "; ".join(_exceeded(search, verdict, name) for name in verdict.limits.excess(verdict.chosen.figures))
    points = search.points()
    kept = sum(not search.limits.excess(point.figures) for point in points)
    if kept:
        names, where = binding(verdict.confirmed, verdict.limits), "in the confirming run"
        short = [f"{kept} of {len(points)} settings kept it in the search, none of the best ones for longer."]
    else:
        names, where, short = binding(points, search.limits), "in the search", []
    bind = " and ".join(NAMES[name] for name in names)
    return [
        f"Not possible here: {asked_words(search.asked)}. The nearest that was found has {exceeded}.",
        *short,
        f"What binds {where} is the limit of {bind}: without it the others could be met.",
    ]


def binding(points: Iterable[Point], limits: Limits) -> tuple[str, ...]:
    """Return the smallest set of limits without which one of the points would be within all others; of several such
    sets the one with the smallest excess."""
    exceeded = [limits.excess(point.figures) for point in points]
    least = min(exceeded, key=lambda excess: (len(excess), max(excess.values(), default=0.0)), default={})
    return tuple(least)


def _exceeded(search: Search, verdict: Verdict, name: str) -> str:
    """Return a figure of the chosen settings with the limit that it exceeds, and the limit's origin."""
    limit = getattr(verdict.limits, name)
    if name in OPTIONS and getattr(search.asked, OPTIONS[name]) is not None:
        reason = ", as asked"
    elif name in ("hover", "deviation"):
        origin = "always allowed" if limit == getattr(ALLOWANCE, name) else "twice the defaults'"
        reason = f": {origin}, as --{name} is not given"
    else:
        reason = ", as the defaults"
    figure = _amount(name, getattr(verdict.chosen.figures, name))
    return f"{NAMES[name]} {figure} (at most {_amount(name, limit)}{reason})"


def _amount(name: str, value: float) -> str:
    """Return a figure with its unit."""
    if not math.isfinite(value):
        return "not measured"
    if name == "cost":
        return f"{value:.3g} of a core"
    if name == "failed":
        return f"{value:g}"
    return f"{1e3 * value:.3g} {'ms' if name == 'longest' else 'mm'}"


def table(verdict: Verdict) -> str:
    """Return the figures of the chosen point, the defaults, the presets and the user's settings."""
    names = ("cost", "longest", "penetration", "hover", "deviation", "failed")
    chosen, search, defaults = verdict.chosen.figures, verdict.short, verdict.defaults
    rows = {"this file": chosen, "  in the search": search, "defaults": defaults, **verdict.others}
    lines = ["".join([f"{'':18}", *(f"{name:>16}" for name in names)])]
    for row, figures in rows.items():
        lines.append("".join([f"{row:18}", *(f"{_amount(name, getattr(figures, name)):>16}" for name in names)]))
    return "\n".join(lines)


def parameter_file(search: Search, verdict: Verdict) -> str:
    """Return the text of the file: comments, then all given parameters with the chosen values of the searched ones."""
    case, known = search.case, space.defaults()
    changed = [f"{name} (default {known[name]})" for name in space.changes(verdict.chosen.values)]
    about = [
        f"Found by `ros2 run smartmesh_ros tune` for {case.title}. Asked: {asked_words(search.asked)}.",
        *case.sources,
        *([] if verdict.keeps else ["NOT POSSIBLE: these are the nearest settings that were found."]),
        f"Changed: {', '.join(changed) or 'nothing, as no settings better than the defaults were found'}.",
        f"Measured over {case.span.confirm:.3g} s of simulated time, in turns, on {os.cpu_count()} cores. "
        "Cost: processor time per simulated second, which is the share of a core. Longest: processor time of the "
        "longest step. Penetration and hover: 99 %. Deviation: of bodies from a run at an eighth of the step, median. "
        "Failed: bodies lost or put back.",
    ]
    lines = [line for text in about for line in textwrap.wrap(text, 118)]
    comments = "\n".join(f"# {line}".rstrip() for line in [*lines, "", *table(verdict).split("\n")])
    values = {**verdict.chosen.values, **case.start, **verdict.chosen.values}
    if values.get("physics.friction") == DEFAULTS["physics.friction"]:
        del values["physics.friction"]
    # rcl cannot read an empty list.
    values = {name: value for name, value in values.items() if value != []}
    return f"{comments}\n{yaml.safe_dump({'/**': {'ros__parameters': values}}, sort_keys=False, width=math.inf)}"
