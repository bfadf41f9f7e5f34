"""Measures the speed-up of processes that share a storage, for docs/tuning.md."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from smartmesh_ros.startup.quiet import silence_pybullet

# Fraction of the area under one process's front at which the front counts as reached.
SAME_FRONT = 0.98


class Run(NamedTuple):
    """A search: for each trial, its end after the start of the processes [s] and the area under the front by then."""

    times: list[float]
    areas: list[float]

    def reached(self, area: float) -> float:
        """Return the time at which the area was reached [s]; infinite = never."""
        return next((time for time, found in zip(*self, strict=True) if found >= area), float("inf"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print, for each seed, when one process and when several processes reach the front of one process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="waves_w04_maps_20")
    parser.add_argument("--trials", type=int, default=48)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args(arguments)
    silence_pybullet()
    for seed in range(options.seeds):
        one, several = (_run(options.scene, options.trials, 100 * seed, jobs) for jobs in (1, options.jobs))
        area = SAME_FRONT * one.areas[-1]
        first, second = one.reached(area), several.reached(area)
        print(
            f"seed {seed}: one process {first:.0f} s of {one.times[-1]:.0f} s, {options.jobs} processes {second:.0f} s "
            f"of {several.times[-1]:.0f} s: front {second / first:.2f}, all trials "
            f"{several.times[-1] / one.times[-1]:.2f} of the time",
            flush=True,
        )
    return 0


def _run(scene: str, trials: int, seed: int, jobs: int) -> Run:
    from smartmesh_ros.tools.tune.front import Point, hypervolume
    from smartmesh_ros.tools.tune.search import Search, prepare
    from smartmesh_ros.tools.tune.session import Request, quiet_optuna
    from smartmesh_ros.tools.tune.workers import Workers

    with tempfile.TemporaryDirectory() as folder:
        quiet_optuna()
        request = Request(
            source=scene, storage=str(Path(folder) / "journal"), seed=seed, plan=replace(Search(), trials=trials)
        )
        case = request.open_case()
        store = request.open_store(case, seed)
        base = prepare(store, case, request.asked, request.plan, lambda _: None)
        corner = (4.0 * base.cost, 10.0 * base.error)
        began = datetime.now()
        with Workers(request, jobs) as workers:
            while workers.wait(0.2):
                pass
        pairs = zip(store.finished(), store.points(), strict=True)
        done = sorted(pairs, key=lambda pair: str(pair[0].datetime_complete))
        times = [(trial.datetime_complete - began).total_seconds() for trial, _ in done if trial.datetime_complete]
        points: list[Point] = [point for _, point in done]
        return Run(times, [hypervolume(points[: count + 1], corner) for count in range(len(points))])


if __name__ == "__main__":
    sys.exit(main())
