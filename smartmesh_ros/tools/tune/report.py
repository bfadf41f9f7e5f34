"""Texts of a search: the line of progress, the report at the end, and the parameter file."""

from __future__ import annotations

import math
import textwrap

import yaml

from smartmesh_ros.tools.evaluation.machine import describe
from smartmesh_ros.tools.tune import space
from smartmesh_ros.tools.tune.choice import binding, ranked
from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import ALLOWANCE, Figures
from smartmesh_ros.tools.tune.search import Search
from smartmesh_ros.tools.tune.start import DEFAULTS

WIDTH = 118
# Names of the limits, and the options that set them, by field.
NAMES = {
    "cost": "cost", "penetration": "penetration", "longest": "the longest step", "hover": "hover",
    "deviation": "deviation", "failed": "bodies lost or put back",
}  # fmt: skip
OPTIONS = {"cost": "budget", "longest": "deadline"}


def progress(search: Search, trials: int, left: float) -> str:
    """Return the line of progress; ``left``: estimated remaining time [s]."""
    points = search.points()
    best = ranked(points, search.asked, search.limits)
    found = f"best so far {costs(best[0].figures)}" if best else "no settings within the limits yet"
    minutes, seconds = divmod(max(round(left), 0), 60)
    return f"{len(points)}/{trials} tried, {minutes}:{seconds:02d} left; {found}; defaults {costs(search.base)}"


def costs(figures: Figures) -> str:
    """Return cost and penetration as a text."""
    return f"{figures.cost:.3f} of a core, {1e3 * figures.penetration:.3g} mm"


def closing_lines(search: Search, verdict: Verdict) -> list[str]:
    """Return the lines of the report."""
    chosen, defaults = verdict.chosen.figures, verdict.defaults
    changed = [f"{name} {value}" for name, value in space.changes(verdict.chosen.values).items()]
    return [
        table(verdict),
        "",
        f"{search.case.title}: {len(search.points())} settings tried, the best confirmed over {chosen.ran:g} s of "
        "simulated time.",
        *_outcome(search, verdict),
        f"Chosen: {chosen.cost / defaults.cost:.2f} times the cost of the defaults, and "
        f"{chosen.error / defaults.error:.2f} times their penetration.",
        f"Changed: {', '.join(changed) or 'nothing'}.",
    ]


def _outcome(search: Search, verdict: Verdict) -> list[str]:
    """Return whether the limits are met, and if not, which ones are exceeded and which ones bind."""
    if verdict.keeps:
        best = " The defaults are on the front: nothing that was found beats them." if verdict.on_front else ""
        return [f"Asked: {search.asked.words}. Kept.{best}"]
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
        f"Not possible here: {search.asked.words}. The nearest that was found has {exceeded}.",
        *short,
        f"What binds {where} is the limit of {bind}: without it the others could be met.",
    ]


def _exceeded(search: Search, verdict: Verdict, name: str) -> str:
    """Return a figure of the chosen settings with the limit that it exceeds, and the limit's origin."""
    limit = getattr(verdict.limits, name)
    option = OPTIONS.get(name, name)
    if getattr(search.asked, option, None) is not None:
        reason = ", as asked"
    elif name in ("hover", "deviation"):
        least = limit == getattr(ALLOWANCE, name)
        reason = f": {'always allowed' if least else 'twice the defaults'}, as --{option} is not given"
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
        cells = [f"{_amount(name, getattr(figures, name)):>16}" for name in names]
        lines.append(f"{row:18}" + (f" {figures.note}" if figures.note else "".join(cells)))
    return "\n".join(lines)


def parameter_file(search: Search, verdict: Verdict) -> str:
    """Return the text of the file: comments, then all given parameters with the chosen values of the searched ones."""
    case, machine, known = search.case, describe(), space.defaults()
    changed = [f"{name} (default {known[name]})" for name in space.changes(verdict.chosen.values)]
    about = [
        f"Found by `ros2 run smartmesh_ros tune` for {case.title}. Asked: {search.asked.words}.",
        *case.sources,
        *([] if verdict.keeps else ["NOT POSSIBLE: these are the nearest settings that were found."]),
        f"Changed: {', '.join(changed) or 'nothing, as no settings better than the defaults were found'}.",
        f"Measured over {verdict.chosen.figures.ran:.3g} s of simulated time, in turns, on {machine['cores']} cores of "
        f"{machine['cpu']}. Cost: processor time per simulated second, which is the share of a core. Longest: processor"
        " time of the longest step. Penetration and hover: 99 %. Deviation: of bodies from a run at an eighth of the "
        "step, median. Failed: bodies lost or put back.",
    ]
    lines = [line for text in about for line in textwrap.wrap(text, WIDTH)]
    comments = "\n".join(f"# {line}".rstrip() for line in [*lines, "", *table(verdict).split("\n")])
    values = {**verdict.chosen.values, **case.start, **verdict.chosen.values}
    if values.get("physics.friction") == DEFAULTS["physics.friction"]:
        del values["physics.friction"]
    # rcl cannot read an empty list.
    values = {name: value for name, value in values.items() if value != []}
    return f"{comments}\n{yaml.safe_dump({'/**': {'ros__parameters': values}}, sort_keys=False, width=math.inf)}"
