"""``make bench``: measures, and writes one JSON, the tables and the pictures."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

from studies.bench import crowds, searching, simple_mesh, smart_mesh
from studies.bench.figures import draw_all
from studies.bench.measure import FULL, QUICK, Bench, Results
from studies.bench.report import BATCHES
from studies.bench.tables import all_tables
from studies.machine import describe, measured_on
from studies.pages import fill
from studies.progress import Progress

RESULTS, TABLES, PICTURES = "bench.json", "tables.md", Path("images/bench")


class Job(NamedTuple):
    """A part of the bench: what it says while it runs, its share of the time, and what it calls with the bench."""

    label: str
    share: float
    run: Callable[..., None]
    arguments: tuple[Any, ...] = ()


def jobs(*, quick: bool) -> list[Job]:
    """All parts, in the order they run."""
    found = [Job(f"whole mesh, {name}", 30.0, simple_mesh.measure_engine, (name,)) for name in simple_mesh.ENGINES]
    found.append(Job("whole mesh, coal", 45.0, simple_mesh.measure_trees))
    for side in smart_mesh.sides(quick):
        found.append(Job(f"patch on {side}x{side}", 4.0, smart_mesh.measure_main_meshes, (side,)))
        if side <= smart_mesh.SIDE:
            found.append(Job(f"frames on {side}x{side}", 5.0, smart_mesh.measure_frames, (side,)))
    found.append(Job("local colliders", 3.0, smart_mesh.measure_local_colliders))
    found += [
        Job(f"searches on {side}x{side}", 1.0, searching.measure_general, (side,))
        for side in searching.report_sides(quick)
    ]
    found += [
        Job(f"searches on a map of {side}x{side}", 3.0, searching.measure_maps, (side,))
        for side in searching.map_sides(quick)
    ]
    found.append(Job("searches in batches", 2.0, searching.measure_batches))
    found.append(Job("collecting", 1.0, searching.measure_collecting))
    found.append(Job("collecting in batches", 1.0, searching.measure_collecting_batches))
    found.append(Job("collider updates", 5.0, crowds.measure_updates))
    for count in BATCHES[:1] if quick else BATCHES:
        if count != crowds.BATCH:
            found.append(Job(f"updates of {count}", 1.0, crowds.measure_batches, (count,)))
        found.append(Job(f"engines, {count} bodies", 15.0, crowds.measure_engines, (crowds.COARSE, count)))
        if count <= crowds.BATCH:  # more do not fit on it
            found.append(Job(f"fine map, {count} bodies", 4.0, crowds.measure_engines, (crowds.FINE, count)))
    found.append(Job("general mesh", 1.0, crowds.measure_general))
    return found


def measure(*, quick: bool) -> Results:
    """Runs every part; a line on stderr tells how far it is."""
    bench, say = Bench(QUICK if quick else FULL), Progress()
    todo = jobs(quick=quick)
    total, done = sum(job.share for job in todo), 0.0
    for job in todo:
        say(f"{done / total:4.0%} {job.label}")
        job.run(bench, *job.arguments)
        done += job.share
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
        data = {"machine": describe(), "quick": given.quick, **measure(quick=given.quick).as_json()}
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
