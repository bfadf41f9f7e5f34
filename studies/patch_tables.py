"""What patches cost by how often they follow their bodies, and what choosing the smallest collider costs, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import geometric_mean, median

from studies.contest import Result
from studies.tables import table

DEFAULTS = "defaults"
# Configurations whose patches follow in every step, at 60 Hz and at 30 Hz.
RATES = ("patches at every step", DEFAULTS, "patches at 30 Hz")
# Gives every body a field.
FIELDS = "heightfield"


def rates_table(titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """How often patches follow: one row a scene, by its name in ``titles``, and the medians over all scenes."""
    rows = [[titles[name], *(_figures(found[rate]) for rate in RATES)] for name, found in _with(RATES, titles, results)]
    often, usual, seldom = zip(
        *([found[rate].cost for rate in RATES] for _, found in _with(RATES, titles, results)), strict=True
    )
    return (
        table(["scene", "every step", "60 Hz, the default", "30 Hz"], rows)
        + f"\n\nOver all scenes (median) the default costs {_median_ratio(usual, often):.2f} of patches in every step, "
        + f"and 30 Hz {_median_ratio(seldom, often):.2f}."
    )


def choosing_table(titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """`auto` beside fields alone: one row a scene, in ascending order of the ratio, and the mean over all scenes."""
    both = (DEFAULTS, FIELDS)
    ratios = {name: found[DEFAULTS].cost / found[FIELDS].cost for name, found in _with(both, titles, results)}
    rows = [
        [titles[name], *(_figures(results[name][one]) for one in both), f"{ratios[name]:.2f}"]
        for name in sorted(ratios, key=lambda name: ratios[name])
    ]
    mean = geometric_mean(ratios.values())
    return (
        table(["scene", "auto", "heightfield", "ratio"], rows)
        + f"\n\nOver all scenes together (geometric mean) `auto` costs {mean:.2f} of heightfields alone."
    )


def _with(
    wanted: Sequence[str], titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]
) -> list[tuple[str, Mapping[str, Result]]]:
    """Return the scenes that have results of all wanted configurations."""
    return [(name, results[name]) for name in titles if set(wanted) <= results[name].keys()]


def _figures(result: Result) -> str:
    """Return the cost [ms], and the penetration [mm] in brackets."""
    return f"{1e-3 * result.cost:.1f} ({1e3 * result.p99:.2g})"


def _median_ratio(costs: Sequence[float], others: Sequence[float]) -> float:
    return median(cost / other for cost, other in zip(costs, others, strict=True))
