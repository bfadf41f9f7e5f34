"""Output of a run: one JSON, the tables, the pictures, and the generated section of the documentation."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

from studies.bench.figures import draw_all
from studies.bench.measure import Results
from studies.bench.tables import all_tables
from studies.machine import measured_on
from studies.pages import fill

BLOCK = "tables"
RESULTS = "bench.json"
TABLES = "tables.md"
PICTURES = Path("images/bench")


class Run(NamedTuple):
    """Results of one run of the bench, the machine, and whether the run was quick."""

    results: Results
    machine: dict[str, Any]
    quick: bool


class Written(NamedTuple):
    """Files of one run."""

    results: Path
    tables: Path
    pictures: list[Path]


def write(run: Run, folder: Path) -> Written:
    """Writes everything into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    data = {"machine": run.machine, "quick": run.quick, **run.results.as_json()}
    (folder / RESULTS).write_text(json.dumps(data, indent=1) + "\n")
    (folder / TABLES).write_text(summary(run))
    return Written(folder / RESULTS, folder / TABLES, draw_all(run.results, folder))


def read(file: Path) -> Run:
    """An earlier run."""
    data = json.loads(file.read_text())
    return Run(Results.from_json(data), data["machine"], data["quick"])


def summary(run: Run) -> str:
    """The machine and all tables."""
    machine = run.machine
    frames = [timing.frames for timing in run.results.timings.values()]
    most, least = max(frames, default=0), min(frames, default=0)
    words = (
        f"{measured_on(machine)}, under a load of {machine['load']} "
        f"(this bench alone: about 1). Medians of {most} frames; of as few as {least} where a frame takes long."
    )
    if run.quick:
        words += " A quick run: too few frames to go by."
    return f"{words}\n\n{all_tables(run.results)}"


def update(document: Path, text: str, pictures: Iterable[Path] = ()) -> None:
    """Puts ``text`` into the block of a document, and the pictures into ``images/bench`` beside it; raises `InputError`
    if it has no such block."""
    fill(document, {BLOCK: text})
    folder = document.parent / PICTURES
    for picture in pictures:
        folder.mkdir(parents=True, exist_ok=True)
        copyfile(picture, folder / picture.name)
