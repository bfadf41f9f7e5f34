"""``make bench``: measures the report's tables again, and fills docs/benchmarks.md."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from studies.bench import searching, smart_mesh
from studies.bench.measure import FULL, QUICK, Bench, Effort, Results
from studies.bench.tables import all_tables
from studies.pages import ROOT, fill
from studies.running import Progress, describe, measured_on, save_results

RESULTS, TABLES, PAGE = "bench.json", "tables.md", ROOT / "docs" / "benchmarks.md"


def jobs(effort: Effort) -> Iterator[tuple[str, Callable[[Bench], None]]]:
    """Yield all parts in the order they run: what each says while it runs, and what it does with the bench."""
    for name in (*smart_mesh.ENGINES, *smart_mesh.COAL):
        yield f"whole mesh, {name}", partial(smart_mesh.measure_whole, name=name)
    for side in effort.of(smart_mesh.SIDES):
        yield f"patch on {side}x{side}", partial(smart_mesh.measure_main_meshes, side=side)
    yield "local colliders", smart_mesh.measure_local_colliders
    for side in effort.of(searching.REPORT_SIDES):
        yield f"searches on {side}x{side}", partial(searching.measure_general, side=side)
    for side in effort.of(searching.MAP_SIDES):
        yield f"searches on a map of {side}x{side}", partial(searching.measure_maps, side=side)
    yield "collecting", searching.measure_collecting
    yield "updates of a batch", smart_mesh.measure_batches
    yield "general mesh", smart_mesh.measure_general


def measure(effort: Effort) -> Results:
    """Runs every part; a line on stderr tells how far it is."""
    bench, say = Bench(effort), Progress()
    todo = list(jobs(effort))
    for number, (label, run) in enumerate(todo, 1):
        say(f"{number} of {len(todo)}: {label}")
        run(bench)
    print(file=sys.stderr)
    return bench.results


def summary(data: dict[str, Any], results: Results) -> str:
    """Return the machine and all tables of a run, of which ``data`` is kept with its results."""
    machine = data["machine"]
    frames = [timing.frames for timing in results.timings.values()]
    most, least = max(frames, default=0), min(frames, default=0)
    words = (
        f"{measured_on(machine)}, under a load of {machine['load']} "
        f"(this bench alone: about 1). Medians of {most} frames; of as few as {least} where a frame takes long."
    )
    if data["quick"]:
        words += " A quick run: too few frames to go by."
    return f"{words}\n\n{all_tables(results)}"


def main(arguments: list[str] | None = None) -> int:
    """Measure; write JSON and tables, and those of a whole run into the page; return the exit status."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few frames, less than a minute: whether it runs at all")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder of the results (%(default)s)")
    given = parser.parse_args(arguments)
    results = measure(QUICK if given.quick else FULL)
    data = {"machine": describe(), "quick": given.quick}
    text = summary(data, results)
    given.out.mkdir(parents=True, exist_ok=True)
    save_results(given.out / RESULTS, data | results.as_json())
    (given.out / TABLES).write_text(text)
    if not given.quick:
        fill(PAGE, {"tables": text})
    print(f"wrote {given.out / TABLES} and {given.out / RESULTS}")
    return 0
