"""A whole search, from the command line's options to the written file."""

from __future__ import annotations

import multiprocessing
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune import chart, report
from smartmesh_ros.tools.tune.confirm import Verdict, confirm
from smartmesh_ros.tools.tune.opening import open_search
from smartmesh_ros.tools.tune.process import take_part
from smartmesh_ros.tools.tune.search import Search


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


@contextmanager
def _helpers(options: Namespace) -> Iterator[None]:
    """Run all but one of ``--jobs`` processes beside the block, and wait for them after it. If the block fails, they
    are ended. Raise `InputError` if one has failed."""
    context = multiprocessing.get_context("spawn")
    helpers = [context.Process(target=take_part, args=(options, index)) for index in range(1, options.jobs)]
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
