"""A whole search, from the command line's options to the written file."""

from __future__ import annotations

import multiprocessing
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

from smartmesh_ros.errors import InputError
from smartmesh_ros.startup.executables import help_tune
from smartmesh_ros.tools.evaluation.scene import FOLDER, read_scene
from smartmesh_ros.tools.tune import chart, report
from smartmesh_ros.tools.tune.bag_case import bag_case
from smartmesh_ros.tools.tune.case import Case, scene_case
from smartmesh_ros.tools.tune.confirm import Verdict, confirm
from smartmesh_ros.tools.tune.figures import Asked, require_positive
from smartmesh_ros.tools.tune.recording import Bag
from smartmesh_ros.tools.tune.search import Search, open_study
from smartmesh_ros.tools.tune.start import read_start


def run_session(options: Namespace) -> int:
    """Search, confirm, write the file and the chart, and print the result; return the exit code."""
    search, verdict = find(options)
    case, out = search.case, options.out
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{case.name}_{'tuned' if verdict.keeps else 'nearest'}.yaml"
    picture = out / f"{case.name}.png"
    file.write_text(report.parameter_file(search, verdict))
    chart.draw(picture, search, verdict)
    for line in report.closing_lines(search, verdict):
        print(line)
    print(f"Written: {file}\nThe chart: {picture}")
    return 0 if verdict.keeps else 1


def find(options: Namespace) -> tuple[Search, Verdict]:
    """Search and confirm; raise `InputError` for invalid options."""
    search = open_search(options)
    for note in search.case.notes:
        print(note)
    _line("measures the defaults and their reference")
    search.prepare()
    with _helpers(options):
        search.run(options.trials, lambda: _line(report.progress(search, options.trials)))
    _line("confirms the best settings over a longer run")
    verdict = confirm(search)
    _line("")
    return search, verdict


def open_search(options: Namespace, index: int = 0) -> Search:
    """Return the search of a command line, as process number ``index``; raise `InputError` for invalid options."""
    for name in ("trials", "jobs", "seconds"):
        require_positive(name, getattr(options, name))
    asked = Asked(**{field.name: getattr(options, field.name) for field in fields(Asked)})
    case = open_case(options)
    seed = None if options.seed is None else options.seed + index
    storage = options.storage or str(options.out / "tune.journal")
    return Search(case, asked, open_study(storage, f"{case.name} {case.identity}", seed))


def open_case(options: Namespace) -> Case:
    """Return the scene or bag; raise `InputError` if neither can be opened."""
    start = read_start(options.params_file, options.preset, options.single)
    path = Path(options.source)
    if not path.exists():
        path = FOLDER / f"{options.source}.yaml"
    if path.suffix == ".yaml" and path.is_file() and path.name != "metadata.yaml":
        return scene_case(read_scene(path), start)
    if path.exists():
        return bag_case(Bag(path), start, options.terrain, options.seconds)
    scenes = ", ".join(sorted(file.stem for file in FOLDER.glob("*.yaml")))
    raise InputError("source", f"there is no bag and no scene {options.source!r}; the scenes are {scenes}")


@contextmanager
def _helpers(options: Namespace) -> Iterator[None]:
    """Run all but one of ``--jobs`` processes beside the block, and wait for them after it. If the block fails, they
    are ended. Raise `InputError` if one has failed."""
    context = multiprocessing.get_context("spawn")
    helpers = [context.Process(target=help_tune, args=(options, index)) for index in range(1, options.jobs)]
    for helper in helpers:
        helper.start()
    try:
        yield
        for helper in helpers:
            helper.join()
    finally:
        for helper in helpers:
            helper.terminate()
    if any(helper.exitcode for helper in helpers):
        raise InputError("jobs", "a process of the search has failed; see its output above")


def _line(text: str) -> None:
    """Replace the terminal's last line; do nothing if stderr is no terminal."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text[:160]}", end="", file=sys.stderr, flush=True)
