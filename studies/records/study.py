"""``make records``: terrain tax, touchdown and size of cells, beside other engines; fills docs/records.md."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from studies.machine import describe, measured_on
from studies.pages import ROOT, fill
from studies.progress import Progress
from studies.records.cells import cells_table
from studies.records.picture import draw
from studies.records.tax import tax_table
from studies.records.touchdown import touchdown_table
from studies.records.world_tax import world_table
from studies.results_file import save_results

PAGE, RESULTS, PICTURE = (ROOT / "docs" / name for name in ("records.md", "records.json", "images/records.png"))
# How often each cost is measured, in turns: in `World`, and in the engines.
WORLD_ROUNDS, ENGINE_ROUNDS = 25, 9


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the tables, write the page and draw the picture."""
    parser = argparse.ArgumentParser(prog="python -m studies records", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two turns in place of all, and no page")
    quick = parser.parse_args(arguments).quick
    say = Progress()
    tables: dict[str, str] = {}
    results: dict[str, Any] = {}
    records: dict[str, Callable[[], tuple[str, Any]]] = {
        "touchdown": touchdown_table,
        "cells": cells_table,
        "tax of engines": lambda: tax_table(2 if quick else ENGINE_ROUNDS),
        "tax": lambda: world_table(2 if quick else WORLD_ROUNDS),
    }
    for name, run in records.items():
        say(name)
        tables[name], results[name] = run()
        print(f"\n{tables[name]}")
    if not quick:
        machine = measured_on(describe())
        save_results(RESULTS, {"machine": describe(), **results})
        fill(PAGE, {name: f"{text}\n\n{machine}." for name, text in tables.items()})
        draw(PICTURE, results["tax of engines"], results["touchdown"], results["cells"])
