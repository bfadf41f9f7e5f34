"""The result of a search, and its text: what is printed at the end is the head of the parameter file."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import yaml

from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Figures, best, binding, excess, limits_of
from smartmesh_ros.tools.tune.grid import KNOWN, own_settings

# Names of the limits, by figure, in the order of the table.
NAMES = {
    "cost": "cost", "longest": "longest step", "penetration": "penetration", "hover": "hover",
    "deviation": "deviation", "failed": "lost, put back",
}  # fmt: skip
MEANING = (
    "Cost: processor time per simulated second, which is the share of a core. Longest step: its processor time. "
    "Penetration and hover: 99 %. Deviation: of bodies from a run at an eighth of the step, median. Lost, put back: "
    "number of bodies."
)


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
        return self._point(KNOWN)

    @property
    def given(self) -> Figures | None:
        """The point of the user's settings, if they are not the defaults."""
        own = own_settings(self.case.parameters)
        return None if own == KNOWN else self._point(own)

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

    def _point(self, values: Mapping[str, float]) -> Figures:
        return next(point for point in self.points if point.values == values)


def lines_of(result: Result) -> list[str]:
    """Return the lines of the report."""
    case, chosen = result.case, result.chosen
    asked = ", ".join(f"{NAMES[name]} at most {_amount(name, value)}" for name, value in result.asked.items())
    kept = "Kept."
    if not result.keeps:
        exceeded = ", ".join(NAMES[name] for name in excess(chosen, result.limits))
        bind = " and ".join(NAMES[name] for name in binding(result.points, result.limits))
        kept = f"NOT POSSIBLE: the nearest settings exceed the limits of {exceeded}. What binds is the limit of {bind}:"
        kept += " without it the others could be met."
    changed = ", ".join(f"{name} {value} (default {KNOWN[name]})" for name, value in result.changed.items())
    texts = [
        f"{case.title}: {len(result.points)} settings, measured over {case.length:.3g} s of simulated time on "
        f"{os.cpu_count()} cores.",
        f"Asked: {asked or 'no more penetration than the defaults have'}. {kept}",
        f"Changed: {changed or 'nothing'}.",
        MEANING,
    ]
    rows = {"this file": vars(chosen), "at most": result.limits, "defaults": vars(result.defaults)}
    if result.given is not None:
        rows["as given"] = vars(result.given)
    table = [f"{'':12}" + "".join(f"{name:>16}" for name in NAMES.values())]
    for row, figures in rows.items():
        table.append(f"{row:12}" + "".join(f"{_amount(name, figures[name]):>16}" for name in NAMES))
    return [*(line for text in texts for line in textwrap.wrap(text, 118)), "", *table]


def _amount(name: str, value: float) -> str:
    """Return a figure with its unit; without a limit, or not measured, a dash."""
    if not math.isfinite(value):
        return "-"
    if name == "cost":
        return f"{value:.3g} of a core"
    if name == "failed":
        return f"{value:g}"
    return f"{1e3 * value:.3g} {'ms' if name == 'longest' else 'mm'}"


def parameter_file(result: Result) -> str:
    """Return the text of the file: the report, then all given parameters with the chosen values of the grid."""
    case, about = result.case, lines_of(result)
    about += [f"Start the node with -r '{old}:={new}'" for old, new in case.remaps]
    comments = "\n".join(f"# {line}".rstrip() for line in about)
    # rcl cannot read an empty list.
    values = {name: value for name, value in {**case.parameters, **result.chosen.values}.items() if value != []}
    return f"{comments}\n{yaml.safe_dump({'/**': {'ros__parameters': values}}, sort_keys=False, width=math.inf)}"
