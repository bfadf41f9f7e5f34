"""What patches cost by how often they follow their bodies, and what choosing the smallest collider costs, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import geometric_mean, median

from studies.contest import Result
from studies.markdown import table

DEFAULTS = "defaults"
# Configurations whose patches follow in every step, at 60 Hz and at 30 Hz.
RATES = ("patches at every step", DEFAULTS, "patches at 30 Hz")
# Gives every body a field.
FIELDS = "heightfield"


def rates_table(titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """How often patches follow: one row a scene, by its name in ``titles``, and the medians over all scenes."""
    rows = [[title, *(_figures(results[name][rate]) for rate in RATES)] for name, title in titles.items()]
    every_step, default, seldom = ([results[name][rate].cost for name in titles] for rate in RATES)
    return (
        table(["scene", "every step", "60 Hz, the default", "30 Hz"], rows)
        + f"\n\nOver all scenes (median) the default costs {median(_ratios(default, every_step)):.2f} of patches in "
        + f"every step, and 30 Hz {median(_ratios(seldom, every_step)):.2f}."
    )


def choosing_table(titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """`auto` beside fields alone: one row a scene, in ascending order of the ratio, and the mean over all scenes."""
    auto, fields = ([results[name][one].cost for name in titles] for one in (DEFAULTS, FIELDS))
    ratios = dict(zip(titles, _ratios(auto, fields), strict=True))
    rows = [
        [titles[name], *(_figures(results[name][one]) for one in (DEFAULTS, FIELDS)), f"{ratios[name]:.2f}"]
        for name in sorted(ratios, key=lambda name: ratios[name])
    ]
    return (
        table(["scene", "auto", "heightfield", "ratio"], rows)
        + f"\n\nOver all scenes together (geometric mean) `auto` costs {geometric_mean(ratios.values()):.2f} of "
        + "heightfields alone."
    )


def _figures(result: Result) -> str:
    """Return the cost [ms], and the penetration [mm] in brackets."""
    return f"{1e-3 * result.cost:.1f} ({1e3 * result.p99:.2g})"


def _ratios(costs: Sequence[float], others: Sequence[float]) -> list[float]:
    return [cost / other for cost, other in zip(costs, others, strict=True)]
