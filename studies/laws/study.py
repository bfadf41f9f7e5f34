"""``make laws``: how well engines keep the laws of contact, and how far runs drift apart; fills docs/accuracy.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.terrain.grid import FloatArray
from studies.configurations import OURS, RATE, Configuration, rivals, robot_configurations
from studies.engines.smartmesh import SmartMeshOptions
from studies.laws.trials import (
    COURSES,
    TRIALS,
    Residuals,
    end_in,
    end_of_husky,
    joined,
    residuals_in,
    residuals_of_husky,
    spread,
)
from studies.markdown import number, table
from studies.pages import ROOT, fill

PAGE = ROOT / "docs" / "accuracy.md"
# Runs, and how far their starts are from the middle one at most [m].
RUNS, FURTHEST = 100, 0.5e-6
ATTACHED = SmartMeshOptions(attached=True, physics=PhysicsConfig(sleep=False))
ROBOTS = {one.name: one for one in robot_configurations(quick=False)}
HEAD = (
    "gap and force", "normal speed [mm/s]", "depth [mm]", "beyond the cone [%]", "off the slip [deg]",
    "friction / cone", "dissipated / largest",
)  # fmt: skip


def competitors() -> list[Configuration]:
    """Return the engines that are compared, ours first; Rapier only as it is more accurate."""
    attached = Configuration(name="defaults, bodies attached", family="ours", engine="smartmesh", options=ATTACHED)
    others = [one for one in rivals() if one.rate == RATE and not one.for_sliding and one.name != "Rapier, 240 Hz"]
    return [OURS[0], attached, *others]


def laws(groups: Sequence[str]) -> str:
    """Return the table of residuals: a row for each group of scenes and engine, and for each engine's husky."""
    found = {
        f"{group}: {one.name}": [residuals_in(one, scene) for scene in TRIALS if scene.name == group]
        for group in groups
        for one in competitors()
    }
    driving = [ROBOTS[one.name] for one in competitors() if one.name in ROBOTS]
    found |= {f"husky: {one.name}": [residuals_of_husky(one)] for one in driving}
    return table(["scenes: engine", *HEAD], [[name, *figures(parts)] for name, parts in found.items()])


def figures(parts: Sequence[Residuals | None]) -> list[str]:
    """Return the cells of a row: mean and 99 % of what should be zero, mean of what should be one."""
    told = [part for part in parts if part is not None]
    if not told:
        return ["-"] * len(HEAD)
    *zeros, used, dissipated = joined(told)
    units = (1.0, 1e3, 1e3, 1e2, np.degrees(1.0))
    cells = [
        f"{_of(unit * values, np.mean)} / {_of(unit * values, partial(np.percentile, q=99))}"
        for unit, values in zip(units, zeros, strict=True)
    ]
    return [*cells, _of(used, np.mean), _of(dissipated, np.mean)]


def _of(values: FloatArray, statistic: Callable[[FloatArray], Any]) -> str:
    """Return a statistic of what is not NaN; rounding errors are zero."""
    known = values[np.isfinite(values)]
    return number(round(float(statistic(known)), 4)) if known.size else "-"


def drifts(runs: int) -> str:
    """Return the table of spreads [mm]: a row for each engine, a column for each scene."""
    rows = []
    for one in competitors():
        cells = [_spread(partial(end_in, one, scene), runs) for scene in COURSES]
        driven = _spread(partial(end_of_husky, ROBOTS[one.name]), runs) if one.name in ROBOTS else "-"
        rows.append([one.name, *cells, driven])
    return table(["engine", *(scene.name for scene in COURSES), "husky drives"], rows)


def _spread(run: Callable[[FloatArray], FloatArray], runs: int) -> str:
    """Return standard deviation and largest difference of the ends of runs from starts within a ball of `FURTHEST`."""
    shifts = np.random.default_rng(1).uniform(-1.0, 1.0, (runs, 3)) * FURTHEST / np.sqrt(3.0)
    return " / ".join(number(1e3 * value) for value in spread(np.array([run(shift) for shift in shifts])))


def main() -> None:
    """Runs the study."""
    text = f"{laws(['slope', 'waves', 'drop'])}\n\n{drifts(RUNS)}"
    print(text)
    fill(PAGE, {"laws": text})


if __name__ == "__main__":
    main()
