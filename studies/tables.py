"""Tables of what contests found."""

from __future__ import annotations

import math
from collections.abc import Mapping

from studies.configurations import Family
from studies.contest import Result
from studies.front import beyond_all, cheapest_as_accurate, deviation_of, distance_of, measures_of, only_by
from studies.markdown import table

OURS = ("ours", "ours, less")


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


def all_tables(study: str, titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]]) -> str:
    """The picture and the table of each scene, by its name in ``titles``."""
    parts = [
        f"## {title}\n\n![](images/{study}/{name}.png)\n\n{scene_table(results[name])}\n"
        for name, title in titles.items()
    ]
    return "\n".join(parts)


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
