"""``make laws``: how well engines keep the laws of contact, and how far runs drift apart; fills docs/accuracy.md."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.terrain.grid import FloatArray
from studies.configurations import OURS, Configuration, rivals
from studies.engines.smartmesh import SmartMeshOptions
from studies.laws.measures import Residuals, joined, spread
from studies.laws.trials import COURSES, TRIALS, end_in, husky_end, residuals_in
from studies.markdown import number, table
from studies.pages import ROOT, fill
from studies.robots.configurations import configurations as robot_configurations

PAGE = ROOT / "docs" / "accuracy.md"
# Runs, of the quick study too, and how far their starts are from the middle one at most [m].
RUNS, QUICK_RUNS, FURTHEST = 100, 2, 0.5e-6
ATTACHED = Configuration(
    name="defaults, bodies attached", family="ours", engine="smartmesh",
    options=SmartMeshOptions(attached=True, physics=PhysicsConfig(sleep=False)),
)  # fmt: skip
RIVALS = (
    "whole trimesh", "whole heightfield", "MuJoCo, 240 Hz", "MuJoCo tuned, 240 Hz", "PhysX, 240 Hz",
    "Rapier stiff, 240 Hz",
)  # fmt: skip
HEAD = (
    "scenes: engine", "gap and force", "normal speed [mm/s]", "depth [mm]", "beyond the cone [%]", "off the slip [deg]",
    "friction / cone", "dissipated / largest",
)  # fmt: skip


def competitors() -> list[Configuration]:
    """Return the engines that are compared, ours first."""
    return [OURS[0], ATTACHED, *(one for one in rivals() if one.name in RIVALS)]


def laws(groups: Sequence[str]) -> str:
    """Return the table of residuals: a row for each group of scenes and engine."""
    rows = []
    for group in groups:
        for one in competitors():
            found = [residuals_in(one, scene) for scene in TRIALS if scene.name == group]
            told = [part for part in found if part is not None]
            rows.append([f"{group}: {one.name}", *(figures(joined(told)) if told else ["-"] * (len(HEAD) - 1))])
    return table(HEAD, rows)


def figures(found: Residuals) -> list[str]:
    """Return the cells of a row: mean and 99 % of what should be zero, mean of what should be one."""
    scaled = found._replace(
        normal_speeds=1e3 * found.normal_speeds, depths=1e3 * found.depths, beyond=1e2 * found.beyond,
        angles=np.degrees(found.angles),
    )  # fmt: skip
    zeros = [f"{_of(values, np.mean)} / {_of(values, partial(np.percentile, q=99))}" for values in scaled[:5]]
    return [*zeros, *(_of(values, np.mean) for values in scaled[5:])]


def _of(values: FloatArray, statistic: Callable[[FloatArray], Any]) -> str:
    """Return a statistic of what is not NaN; rounding errors are zero."""
    known = values[np.isfinite(values)]
    return number(round(float(statistic(known)), 4)) if known.size else "-"


def drifts(runs: int) -> str:
    """Return the table of spreads [mm]: a row for each engine, a column for each scene."""
    robots = {one.name: one for one in robot_configurations(quick=False)}
    rows = []
    for one in competitors():
        cells = [_spread(partial(end_in, one, scene), runs) for scene in COURSES]
        driven = _spread(partial(husky_end, robots[one.name]), runs) if one.name in robots else "-"
        rows.append([one.name, *cells, driven])
    return table(["engine", *(scene.name for scene in COURSES), "husky drives"], rows)


def _spread(run: Callable[[FloatArray], FloatArray], runs: int) -> str:
    """Return standard deviation and largest difference of the ends of runs from starts within a ball of `FURTHEST`."""
    shifts = np.random.default_rng(1).uniform(-1.0, 1.0, (runs, 3)) * FURTHEST / np.sqrt(3.0)
    return " / ".join(number(1e3 * value) for value in spread(np.array([run(shift) for shift in shifts])))


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(prog="python -m studies laws", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a slope, and two runs of each scene; printed only")
    quick = parser.parse_args(arguments).quick
    groups = ["slope"] if quick else ["slope", "waves", "drop"]
    text = f"{laws(groups)}\n\n{drifts(QUICK_RUNS if quick else RUNS)}"
    print(text)
    if not quick:
        fill(PAGE, {"laws": text})


if __name__ == "__main__":
    main()
