"""``python -m studies consumer``: MuJoCo on served patches beside MuJoCo with a height field of the whole map."""

from __future__ import annotations

import argparse
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.startup.domains import isolated_unless_chosen
from studies.bench.markdown import table
from studies.consumer.cases import Case
from studies.consumer.drive import Drive
from studies.consumer.run import run_case
from studies.load.study import machine
from studies.pages import fill

PAGE = Path("docs/other_simulators.md")
CASES = (
    Case(source="patches", scene="waves", map_rate=20.0),
    Case(source="patches", scene="waves", map_rate=60.0),
    Case(source="patches", scene="elevation"),
    Case(source="patches", scene="waves", side=1001, resolution=0.02),
    Case(source="map", scene="waves", map_rate=60.0),
    Case(source="map", scene="waves", side=1001, resolution=0.02),
)


def drives(results: list[tuple[Case, Drive]]) -> str:
    """How the wheels kept to the true ground."""
    rows = []
    for case, d in results:
        clearance, ages = 1e3 * np.array(d.clearance), 1e3 * np.array(d.ages)
        rows.append(
            [
                f"{case.name}: {_SOURCES[case.source]}",
                _three(ages),
                f"{max(-np.percentile(clearance, 1), 0.0):.1f}",
                f"{max(np.percentile(clearance, 99), 0.0):.1f}",
                f"{np.percentile(np.abs(clearance), 99):.1f}",
                str(d.lost),
            ]
        )
    header = ["ground", "age 50 / 99 / 100 % [ms]", "sunk in, 99 % [mm]", "above, 99 % [mm]", "off, 99 % [mm]", "lost"]
    return table(header, rows)


def costs(results: list[tuple[Case, Drive]]) -> str:
    """What the simulator's process, and the node, took."""
    rows = []
    for case, d in results:
        beside = 100.0 * (d.cpu - d.steps) / case.seconds
        rows.append(
            [
                f"{case.name}: {_SOURCES[case.source]}",
                f"{1e6 * d.steps / (case.seconds / 0.002):.0f}",
                f"{beside:.0f}",
                f"{1e3 * float(np.median(d.taking)):.2f}" if d.taking else "-",
                f"{d.messages / case.seconds:.0f}",
                f"{d.memory:.0f}",
                "-" if math.isnan(d.node) else f"{100.0 * d.node:.0f}",
            ]
        )
    header = [
        "ground", "`mj_step` [us]", "simulator beside its steps [% of a core]", "writing one map [ms]",
        "messages a second", "memory [MiB]", "node [% of a core]",
    ]  # fmt: skip
    return table(header, rows)


_SOURCES = {"patches": "served patches", "map": "whole map"}


def _three(values: NDArray[np.float64]) -> str:
    return " / ".join(f"{value:.0f}" for value in np.percentile(values, [50, 99, 100]))


def main(args: list[str] | None = None) -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="drives of 5 s; writes no page")
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each drive [s]")
    options = parser.parse_args(args)
    results = []
    with isolated_unless_chosen():
        for case in CASES:
            chosen = replace(case, seconds=5.0) if options.quick else replace(case, seconds=options.seconds)
            results.append((chosen, run_case(chosen)))
            print(f"{chosen.name}: {_SOURCES[chosen.source]}, {results[-1][1].way:.1f} m", flush=True)
    blocks = {
        "drives": drives(results),
        "costs": costs(results),
        "machine": f"Machine: {machine()}; load average {os.getloadavg()[1]:.1f}.",
    }
    print("\n\n".join(blocks.values()))
    if not options.quick:
        fill(PAGE, blocks)
        print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
