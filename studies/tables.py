"""The study's tables as Markdown, and the blocks of a document that they replace."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from smartmesh_ros.evaluation.scene import Scene
from studies.configurations import Configuration
from studies.contest import Result
from studies.front import beyond_all, cheapest_as_accurate, error_of, pareto_front

OURS = ("ours", "ours, less")


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others are numbers."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def scene_table(results: Mapping[str, Result]) -> str:
    """Everything measured in one scene, a configuration a row; those on the Pareto front are bold."""
    front = pareto_front(results)
    rows = []
    for name, r in results.items():
        shown = f"**{name}**" if name in front else name
        if math.isnan(r.cost):
            rows.append([f"{name}: {r.note}", *["-"] * 9])
            continue
        note = f" ({r.note})" if r.note else ""
        rows.append(
            [
                shown + note, f"{r.cost / 1e3:.2f}", f"{r.spread[0] / 1e3:.2f}-{r.spread[1] / 1e3:.2f}",
                f"{r.update / 1e3:.2f}", *(_mm(value) for value in (r.p50, r.p99, r.most, r.hover)),
                f"{r.lost} of {r.bodies}", f"{_mm(r.deviation)} / {_mm(r.most_deviation)}",
            ]
        )  # fmt: skip
    header = [
        "configuration", "cost [ms]", "quartiles", "update [ms]", "p50 [mm]", "p99 [mm]", "max [mm]", "hover [mm]",
        "lost", "deviation, median / max [mm]",
    ]  # fmt: skip
    return table(header, rows)


def summary_table(
    scenes: Sequence[Scene], results: Mapping[str, Mapping[str, Result]], known: Mapping[str, Configuration]
) -> str:
    """One row a scene: the defaults, and how they stand against the rivals."""
    rows = []
    for scene in scenes:
        found = results[scene.name]
        ours = {name: result for name, result in found.items() if known[name].family in OURS}
        rivals = {name: result for name, result in found.items() if known[name].family not in OURS}
        own = found["defaults"]
        equal = cheapest_as_accurate(rivals, error_of(own))
        factor = f"{equal}: {found[equal].cost / own.cost:.2g} x" if equal else "none is as accurate"
        fastest = cheapest_as_accurate(rivals, math.inf)
        quick = (
            "-"
            if fastest is None
            else f"{fastest}: {found[fastest].cost / own.cost:.2g} x, {_mm(found[fastest].p99)} mm"
        )
        above = beyond_all(ours, rivals, trajectory=True)
        strays = [name for name in beyond_all(ours, rivals, trajectory=False) if name not in above]
        rows.append(
            [
                scene.title, f"{own.cost / 1e3:.2f}", _mm(own.p99), f"{own.lost} of {own.bodies}", factor, quick,
                ", ".join(above) or "none", ", ".join(strays) or "none",
            ]
        )  # fmt: skip
    header = [
        "scene", "defaults: cost [ms]", "p99 [mm]", "lost", "cheapest rival at no more penetration", "cheapest rival",
        "faster and more accurate than all of ours", "the same, but further from where bodies go",
    ]  # fmt: skip
    return table(header, rows)


def _mm(metres: float) -> str:
    return "-" if math.isnan(metres) else f"{1e3 * metres:.2f}"
