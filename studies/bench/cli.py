"""``make bench``: measures, and writes one JSON, the tables and the pictures."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from shutil import copyfile
from typing import Any

from studies.bench import crowds, searching, smart_mesh
from studies.bench.figures import draw_all
from studies.bench.measure import FULL, QUICK, Bench, Effort, Results
from studies.bench.report import BATCHES
from studies.bench.tables import all_tables
from studies.machine import describe, measured_on
from studies.pages import fill
from studies.progress import Progress

RESULTS, TABLES, PICTURES = "bench.json", "tables.md", Path("images/bench")


def jobs(effort: Effort) -> Iterator[tuple[str, Callable[[Bench], None]]]:
    """Yield all parts in the order they run: what each says while it runs, and what it does with the bench."""
    for name in (*smart_mesh.ENGINES, *smart_mesh.COAL):
        yield f"whole mesh, {name}", partial(smart_mesh.measure_whole, name=name)
    for side in effort.of(smart_mesh.SIDES):
        yield f"patch on {side}x{side}", partial(smart_mesh.measure_main_meshes, side=side)
        if side <= smart_mesh.SIDE:
            yield f"frames on {side}x{side}", partial(smart_mesh.measure_frames, side=side)
    yield "local colliders", smart_mesh.measure_local_colliders
    for side in effort.of(searching.REPORT_SIDES):
        yield f"searches on {side}x{side}", partial(searching.measure_general, side=side)
    for side in effort.of(searching.MAP_SIDES):
        yield f"searches on a map of {side}x{side}", partial(searching.measure_maps, side=side)
    yield "searches in batches", searching.measure_batches
    yield "collecting", searching.measure_collecting
    yield "collecting in batches", searching.measure_collecting_batches
    yield "collider updates", crowds.measure_updates
    for count in effort.of(BATCHES):
        if count != crowds.BATCH:
            yield f"updates of {count}", partial(crowds.measure_batches, count=count)
        yield f"engines, {count} bodies", partial(crowds.measure_engines, scale=crowds.COARSE, count=count)
        if count <= crowds.BATCH:  # more do not fit on it
            yield f"fine map, {count} bodies", partial(crowds.measure_engines, scale=crowds.FINE, count=count)
    yield "general mesh", crowds.measure_general


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
    """Return the machine and all tables of a run, from its JSON ``data`` and its results."""
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
    """Measure, or read an earlier run; write JSON, tables and pictures; return the exit status."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few frames, less than a minute: whether it runs at all")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder of the results (%(default)s)")
    parser.add_argument("--from", type=Path, dest="earlier", help="a bench.json, to write tables and pictures from")
    parser.add_argument("--document", type=Path, help="a markdown file whose block ``tables`` is to be written anew")
    given = parser.parse_args(arguments)
    if given.earlier:
        data = json.loads(given.earlier.read_text())
    else:
        data = {"machine": describe(), "quick": given.quick, **measure(QUICK if given.quick else FULL).as_json()}
    results = Results.from_json(data)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / RESULTS).write_text(json.dumps(data, indent=1) + "\n")
    (given.out / TABLES).write_text(summary(data, results))
    pictures = draw_all(results, given.out)
    if given.document:
        fill(given.document, {"tables": summary(data, results)})
        folder = given.document.parent / PICTURES
        folder.mkdir(parents=True, exist_ok=True)
        for picture in pictures:
            copyfile(picture, folder / picture.name)
    print(f"wrote {given.out / TABLES} and {given.out / RESULTS}")
    return 0
