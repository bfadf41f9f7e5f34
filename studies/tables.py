"""Tables of what contests found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import geometric_mean, median

from studies.configurations import Family
from studies.contest import Result
from studies.front import beyond_all, cheapest_as_accurate, deviation_of, distance_of, measures_of, only_by
from studies.markdown import table

OURS = ("ours", "ours, less")
DEFAULTS = "defaults"
# Configurations whose patches follow in every step, at 60 Hz and at 30 Hz.
RATES = ("patches at every step", DEFAULTS, "patches at 30 Hz")
# Gives every body a field.
FIELDS = "heightfield"


def scene_table(results: Mapping[str, Result]) -> str:
    """Everything measured in one scene, a configuration a row; those on the Pareto front are bold, with the measure if
    they are there by one only."""
    front = only_by(results)
    has_update = any(not math.isnan(result.update) for result in results.values())
    rows = []
    for name, r in results.items():
        shown = f"**{name}**{f' (by {front[name]})' if front[name] else ''}" if name in front else name
        if math.isnan(r.cost):
            rows.append([f"{name}: {r.note}", *["-"] * (8 + has_update)])
            continue
        note = f" ({r.note})" if r.note else ""
        update = [f"{r.update / 1e3:.2f}"] if has_update else []
        rows.append(
            [
                shown + note, f"{r.cost / 1e3:.2f}", f"{r.spread[0] / 1e3:.2f}-{r.spread[1] / 1e3:.2f}",
                *update, *(_mm(value) for value in (r.p50, r.p99, r.most, r.hover)),
                f"{r.lost} of {r.bodies}", f"{_mm(r.deviation)} / {_mm(r.most_deviation)}",
            ]
        )  # fmt: skip
    header = [
        "configuration", "cost [ms]", "quartiles", *(["update [ms]"] if has_update else []), "p50 [mm]", "p99 [mm]",
        "max [mm]", "hover [mm]", "lost", "deviation, median / max [mm]",
    ]  # fmt: skip
    return table(header, rows)


def summary_table(
    titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]], families: Mapping[str, Family]
) -> str:
    """One row a scene, by its name in ``titles``: the defaults, and how they stand against the rivals."""
    rows = []
    for scene, title in titles.items():
        found = results[scene]
        ours = {name: result for name, result in found.items() if families[name] in OURS}
        rivals = {name: result for name, result in found.items() if families[name] not in OURS}
        own = found["defaults"]
        both = deviation_of(own) if len(measures_of(found)) > 1 else math.inf
        fastest = cheapest_as_accurate(rivals)
        rows.append(
            [
                title, f"{own.cost / 1e3:.2f}", _mm(distance_of(own)), _mm(own.deviation),
                f"{own.lost} of {own.bodies}",
                _factor(rivals, cheapest_as_accurate(rivals, distance_of(own)), own),
                _factor(rivals, cheapest_as_accurate(rivals, distance_of(own), both), own),
                "-" if fastest is None else f"{_factor(rivals, fastest, own)}, {_mm(distance_of(found[fastest]))} mm",
                ", ".join(beyond_all(ours, rivals, trajectory=True)) or "none",
            ]
        )  # fmt: skip
    header = [
        "scene", "defaults: cost [ms]", "distance [mm]", "deviation [mm]", "lost",
        "cheapest rival no further from the ground", "nor from the reference", "cheapest rival, and its distance",
        "faster and more accurate than all of ours",
    ]  # fmt: skip
    return table(header, rows)


def front_table(
    titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]], families: Mapping[str, Family]
) -> str:
    """Who is on the front over cost, distance and deviation, a scene a row."""
    rows = []
    for scene, title in titles.items():
        by = only_by(results[scene])
        ours = [name for name in by if families[name] in OURS]
        row = [title]
        for names in (ours, [name for name in by if name not in ours]):
            words = [name if not by[name] else f"{name} ({by[name]})" for name in names]
            row.append(", ".join(words) or "none")
        rows.append(row)
    return table(["scene", "ours on the front", "rivals on the front"], rows)


def _factor(rivals: Mapping[str, Result], name: str | None, own: Result) -> str:
    return "none" if name is None else f"{name}: {rivals[name].cost / own.cost:.2g} x"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2f}" if math.isfinite(metres) else "-"


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
