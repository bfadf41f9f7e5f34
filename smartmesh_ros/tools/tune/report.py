"""The result of a search, and its texts: the report at the end, and the parameter file."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import yaml

from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import FACTOR, LEAST, Figures, excess, limits_of
from smartmesh_ros.tools.tune.grid import KNOWN, best, own_settings, point_of

# Names of the limits, by figure, in the order of the table.
NAMES = {
    "cost": "cost", "longest": "the longest step", "penetration": "penetration", "hover": "hover",
    "deviation": "deviation", "failed": "bodies lost or put back",
}  # fmt: skip


@dataclass(frozen=True)
class Result:
    """What was measured of a case, and what of it is chosen for the limits that were ``asked`` for, by figure.
    ``points``: the defaults and the user's settings among them."""

    case: Case
    asked: Mapping[str, float]
    points: Sequence[Figures]

    @cached_property
    def defaults(self) -> Figures:
        """The point of the defaults."""
        return point_of(self.points, KNOWN)

    @property
    def given(self) -> Figures | None:
        """The point of the user's settings, if they are not the defaults."""
        own = own_settings(self.case.parameters)
        return None if own == KNOWN else point_of(self.points, own)

    @cached_property
    def limits(self) -> dict[str, float]:
        """The limits, by figure."""
        return limits_of(self.asked, self.defaults)

    @cached_property
    def chosen(self) -> Figures:
        """The best point within all limits, or else the nearest."""
        return best(self.points, self.asked, self.limits)

    @property
    def keeps(self) -> bool:
        """True if the chosen point is within all limits."""
        return not excess(self.chosen, self.limits)

    @property
    def changed(self) -> dict[str, Any]:
        """The parameters of the grid whose chosen values are not the defaults."""
        return {
            name: self.chosen.values[name] for name, default in KNOWN.items() if self.chosen.values[name] != default
        }


def asked_words(asked: Mapping[str, float]) -> str:
    """Return the user's limits as a text."""
    said = [f"{NAMES[name]} at most {_amount(name, value)}" for name, value in asked.items()]
    return ", ".join(said) or "no more penetration than the defaults have"


def closing_lines(result: Result) -> list[str]:
    """Return the lines of the report."""
    chosen, defaults = result.chosen, result.defaults
    return [
        table(result),
        "",
        f"{result.case.title}: {len(result.points)} settings over {result.case.length:.3g} s of simulated time.",
        *_outcome(result),
        f"Chosen: {chosen.cost / defaults.cost:.2f} times the cost of the defaults, and "
        f"{chosen.error / defaults.error:.2f} times their penetration.",
        f"Changed: {', '.join(f'{name} {value}' for name, value in result.changed.items()) or 'nothing'}.",
    ]


def _outcome(result: Result) -> list[str]:
    """Return whether the limits are met, and if not, which ones are exceeded and which ones bind."""
    if result.keeps:
        nothing = "" if result.changed else " Nothing else on the grid beats the defaults."
        return [f"Asked: {asked_words(result.asked)}. Kept.{nothing}"]
    exceeded = "; ".join(_exceeded(result, name) for name in excess(result.chosen, result.limits))
    bind = " and ".join(NAMES[name] for name in binding(result.points, result.limits))
    return [
        f"Not possible here: {asked_words(result.asked)}. The nearest settings have {exceeded}.",
        f"What binds is the limit of {bind}: without it the others could be met.",
    ]


def binding(points: Iterable[Figures], limits: Mapping[str, float]) -> tuple[str, ...]:
    """Return the smallest set of limits without which one of the points would be within all others; of several such
    sets the one with the smallest excess."""
    exceeded = [excess(point, limits) for point in points]
    least: Mapping[str, float] = min(exceeded, key=lambda over: (len(over), max(over.values(), default=0.0)))
    return tuple(least)


def _exceeded(result: Result, name: str) -> str:
    """Return a figure of the chosen settings with the limit that it exceeds, and the limit's origin."""
    limit = result.limits[name]
    if name in result.asked:
        reason = ", as asked"
    elif name in LEAST:
        reason = ": always allowed" if limit == LEAST[name] else f": {FACTOR:g} times the defaults'"
    else:
        reason = ", as the defaults"
    figure = _amount(name, getattr(result.chosen, name))
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


def table(result: Result) -> str:
    """Return the figures of the chosen point, the defaults and the user's settings."""
    rows = {"this file": result.chosen, "defaults": result.defaults}
    if result.given is not None:
        rows["as given"] = result.given
    lines = ["".join([f"{'':12}", *(f"{name:>16}" for name in NAMES)])]
    for row, point in rows.items():
        lines.append("".join([f"{row:12}", *(f"{_amount(name, getattr(point, name)):>16}" for name in NAMES)]))
    return "\n".join(lines)


def parameter_file(result: Result) -> str:
    """Return the text of the file: comments, then all given parameters with the chosen values of the grid."""
    case, changed = result.case, [f"{name} (default {KNOWN[name]})" for name in result.changed]
    remaps = "".join(f" -r '{old}:={new}'" for old, new in case.remaps)
    about = [
        f"Found by `ros2 run smartmesh_ros tune` for {case.title}. Asked: {asked_words(result.asked)}.",
        *([f"Start the node with{remaps}."] if remaps else []),
        *([] if result.keeps else ["NOT POSSIBLE: these are the nearest settings that were found."]),
        f"Changed: {', '.join(changed) or 'nothing, as no settings better than the defaults were found'}.",
        f"Measured over {case.length:.3g} s of simulated time on {os.cpu_count()} cores. Cost: processor time per "
        "simulated second, which is the share of a core. Longest: processor time of the longest step. Penetration and "
        "hover: 99 %. Deviation: of bodies from a run at an eighth of the step, median. Failed: bodies lost or put "
        "back.",
    ]
    lines = [line for text in about for line in textwrap.wrap(text, 118)]
    comments = "\n".join(f"# {line}".rstrip() for line in [*lines, "", *table(result).split("\n")])
    # rcl cannot read an empty list.
    values = {name: value for name, value in {**case.parameters, **result.chosen.values}.items() if value != []}
    return f"{comments}\n{yaml.safe_dump({'/**': {'ros__parameters': values}}, sort_keys=False, width=math.inf)}"
