"""A whole search, from the command line's options to the written file."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

import optuna

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.evaluation.scene import FOLDER, read_scene
from smartmesh_ros.tools.tune import chart
from smartmesh_ros.tools.tune.bag import Bag
from smartmesh_ros.tools.tune.bag_case import BagCase
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.confirm import Confirming, Verdict, confirm
from smartmesh_ros.tools.tune.figures import Asked, Figures
from smartmesh_ros.tools.tune.front import Point
from smartmesh_ros.tools.tune.parameter_file import parameter_file, table
from smartmesh_ros.tools.tune.scene_case import SceneCase
from smartmesh_ros.tools.tune.search import Say, Search, prepare, work
from smartmesh_ros.tools.tune.start import read_start
from smartmesh_ros.tools.tune.store import Store, open_storage
from smartmesh_ros.tools.tune.words import closing_lines, progress
from smartmesh_ros.tools.tune.workers import Workers


@dataclass(frozen=True, kw_only=True)
class Request:
    """Everything that a process needs to take part in a search."""

    source: str
    params_file: Path | None = None
    preset: str = ""
    single: tuple[str, ...] = ()
    terrain: str = ""
    seconds: float | None = None
    asked: Asked = field(default_factory=Asked)
    plan: Search = field(default_factory=Search)
    storage: str = ""
    seed: int | None = None

    @classmethod
    def of(cls, options: argparse.Namespace) -> Request:
        """Return the request of a command line; raise `InputError` for invalid numbers."""
        for name, least in (("trials", 1), ("jobs", 1)):
            if getattr(options, name) < least:
                raise InputError("parameter", f"--{name} is {getattr(options, name)}; it must be {least} or more")
        if options.seconds is not None and not 0.0 < options.seconds < float("inf"):
            raise InputError("parameter", f"--seconds is {options.seconds:g}; it must be a number greater than zero")
        asked = Asked(
            budget=options.budget, penetration=options.penetration, deadline=options.deadline, hover=options.hover,
            deviation=options.deviation,
        )  # fmt: skip
        return cls(
            source=options.source, params_file=options.params_file, preset=options.preset,
            single=tuple(options.single), terrain=options.terrain, seconds=options.seconds, asked=asked,
            plan=Search(trials=options.trials), storage=options.storage or str(options.out / "tune.journal"),
            seed=options.seed,
        )  # fmt: skip

    def open_case(self) -> Case:
        """Return the scene or bag; raise `InputError` if neither can be opened."""
        start = read_start(self.params_file, self.preset, self.single)
        path = Path(self.source)
        named = FOLDER / f"{self.source}.yaml"
        if named.is_file() and not path.exists():
            return SceneCase(read_scene(named), start)
        if path.suffix == ".yaml" and path.is_file() and path.name != "metadata.yaml":
            return SceneCase(read_scene(path), start)
        if path.exists():
            return BagCase(Bag(path), start, self.terrain, self.seconds)
        scenes = ", ".join(sorted(file.stem for file in FOLDER.glob("*.yaml")))
        raise InputError("source", f"there is no bag and no scene {self.source!r}; the scenes are {scenes}")

    def open_store(self, case: Case, seed: int | None) -> Store:
        """Return the stored results of the case; raise `InputError` if the storage does not open."""
        return Store(open_storage(self.storage), f"{case.name}-{case.identity}", seed)


def take_part(request: Request, seed: int | None, say: Say) -> None:
    """Measure trials of a prepared search until it has enough."""
    quiet_optuna()
    case = request.open_case()
    work(request.open_store(case, seed), case, request.asked, request.plan, say)


def quiet_optuna() -> None:
    """Silence Optuna's log. Errors still raise."""
    optuna.logging.set_verbosity(optuna.logging.CRITICAL)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)


def run_session(options: argparse.Namespace) -> int:
    """Search, confirm, write the file and report; return the exit code."""
    request = Request.of(options)
    case = request.open_case()
    for note in case.notes:
        print(note)
    points, verdict = find(request, case, options.jobs)
    _report(request, case, points, verdict, options.out)
    return 0 if verdict.keeps else 1


def find(request: Request, case: Case, jobs: int) -> tuple[list[Point], Verdict]:
    """Search and confirm; return all tried points and the verdict."""
    quiet_optuna()
    store = request.open_store(case, request.seed)
    base = prepare(store, case, request.asked, request.plan, _line)
    search(request, case, store, base, jobs)
    points = store.points()
    verdict = confirm(case, points, request.asked, base, store.reference, Confirming(), _line)
    _line("")
    return points, verdict


def search(request: Request, case: Case, store: Store, base: Figures, jobs: int) -> None:
    """Measure the trials in this process or in ``jobs`` processes, and show the progress."""
    began, before = monotonic(), len(store.finished())

    def say(_: str) -> None:
        points = store.points()
        done = len(points)
        pace = (monotonic() - began) / max(done - before, 1)
        left = pace * max(request.plan.trials - done, 0)
        _line(progress(done, request.plan.trials, left, points, request.asked, base))

    if jobs == 1:
        work(store, case, request.asked, request.plan, say)
        return
    with Workers(request, jobs) as workers:
        while workers.wait(1.0):
            say("")


def _report(request: Request, case: Case, points: Sequence[Point], verdict: Verdict, out: Path) -> None:
    """Write the file and the chart, and print the result."""
    name = f"{case.name}_tuned" if verdict.keeps else f"{case.name}_nearest"
    out.mkdir(parents=True, exist_ok=True)
    file, picture = out / f"{name}.yaml", out / f"{case.name}.png"
    file.write_text(parameter_file(case, request.asked, verdict))
    chart.draw(picture, case.title, points, verdict)
    print(chart.in_terminal(points, verdict))
    print(f"\n{table(verdict)}\n")
    for line in closing_lines(case.title, request.asked, verdict, points, str(file)):
        print(line)
    print(f"The chart: {picture}")


def _line(text: str) -> None:
    """Replace the terminal's last line; do nothing if stderr is no terminal."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text[:160]}", end="", file=sys.stderr, flush=True)
