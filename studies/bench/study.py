"""``make bench``: measures the report's tables again, and further ones, and fills docs/benchmarks.md."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

from studies.bench import report, searching, smart_mesh
from studies.bench.measure import FULL, LONGEST_FRAME, QUICK, Bench, Effort
from studies.bench.searching import MAP_SIDES
from studies.bench.smart_mesh import BATCH, BATCH_SIDE, SIDE
from studies.pages import ROOT, fill, number, table, times
from studies.running import describe, measured_on, save_results, say

# Above one: today is faster.
RATIO = "report / today"
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
    yield "general mesh", smart_mesh.measure_general


def main(arguments: list[str] | None = None) -> int:
    """Measure; write JSON and tables, and those of a whole run into the page; return the exit status."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few frames, less than a minute: whether it runs at all")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder of the results (%(default)s)")
    given = parser.parse_args(arguments)
    bench = Bench(QUICK if given.quick else FULL)
    for label, run in jobs(bench.effort):
        say(label)
        run(bench)
    machine, frames = describe(), [timing.frames for timing in bench.timings.values()]
    text = (
        f"{measured_on(machine)}, under a load of {machine['load']} (this bench alone: about 1). Medians of "
        f"{max(frames)} frames; of as few as {min(frames)} where a frame takes long.\n\n{all_tables(bench)}"
    )
    given.out.mkdir(parents=True, exist_ok=True)
    timings = [asdict(case) | timing._asdict() for case, timing in bench.timings.items()]
    data = {"machine": machine, "quick": given.quick, "left_out": bench.left_out, "timings_us": timings}
    save_results(given.out / RESULTS, data)
    (given.out / TABLES).write_text(text)
    if not given.quick:
        fill(PAGE, {"tables": text})
    print(f"\nwrote {given.out / TABLES} and {given.out / RESULTS}")
    return 0


SEARCHES = {
    "brute_force": "brute force",
    "ray_cast": "ray cast",
    "best_first": "best-first",
    "best_first_worst": "best-first, worst",
    "grid_traversal": "grid traversal",
    "grid_traversal_worst": "grid traversal, worst",
}


class Column(NamedTuple):
    """The case ``what``, ``method`` under a ``title``, beside the figures that the report has [ms], by the size of the
    mesh or by the rings of the collider; None = it has none. ``today``: title of today's figures."""

    title: str
    what: str
    method: str
    reported: Mapping[int, float] | None = None
    today: str = "today"

    def head(self) -> list[str]:
        """Return its headings."""
        return [self.title] if self.reported is None else [f"{self.title}, report", self.today, RATIO]

    def cells(self, bench: Bench, side: int, rings: int = 0) -> list[str]:
        """Return its cells for a main mesh of ``side`` x ``side``, and colliders of ``rings``, 0 = of one size."""
        if self.what == "update":  # of a batch, for one of its bodies
            return [number(update_per_body(bench, rings) / 1e3)]
        today = bench.us(self.what, self.method, side=side, rings=rings) / 1e3
        if self.reported is None:
            return [number(today)]
        known = self.reported.get(rings or side, math.nan)
        return [number(known), number(today), times(known / today)]


def update_per_body(bench: Bench, rings: int) -> float:
    """Update of a heightfield patch in a batch, all in, per body [us]."""
    return bench.us("update", "heightfield", side=BATCH_SIDE, bodies=BATCH, rings=rings) / BATCH


def by_side(bench: Bench, first: str, sides: Iterable[int], *columns: Column) -> str:
    """Return a table with a row for each size of the main mesh."""
    rows = [[f"{side}x{side}", *(cell for one in columns for cell in one.cells(bench, side))] for side in sides]
    return table([first, *(title for one in columns for title in one.head())], rows)


def by_rings(bench: Bench, *columns: Column) -> str:
    """Return a table with a row for each size of the local collider."""
    rows = [
        [f"{2 * rings + 1}x{2 * rings + 1}", *(cell for one in columns for cell in one.cells(bench, SIDE, rings))]
        for rings in report.RINGS
    ]
    return table(["collider", *(title for one in columns for title in one.head())], rows)


WHOLE = (*report.SIMPLE_PHYSX, *report.LARGER)
TABLE_1 = (
    Column("PhysX", "simple", "physx", report.SIMPLE_PHYSX),
    Column("Bullet (refit)", "simple", "bullet_trimesh", report.SIMPLE_BULLET, "PyBullet (anew), today"),
)
SIMPLE = (
    Column("PhysX, cooked", "simple", "physx"),
    Column("PyBullet trimesh, built anew", "simple", "bullet_trimesh"),
    Column("PyBullet heightfield, replaced", "simple", "bullet_heightfield"),
    Column("coal BVH, built anew", "simple", "coal_rebuild"),
    Column("coal BVH, refitted", "simple", "coal_refit"),
    Column("coal heights, updated", "simple", "coal_heightfield"),
    Column("MuJoCo, written", "simple", "mujoco"),
)
TABLE_2 = (
    Column("PhysX", "smart", "physx", report.SMART_PHYSX),
    Column("Bullet trimesh", "smart", "trimesh", report.SMART_BULLET),
    Column("heightfield replaced, today", "smart", "heightfield"),
)
TABLE_3 = (
    Column("varying", "local", "varying", report.LOCAL_VARYING),
    Column("constant", "local", "constant", report.LOCAL_CONSTANT),
    Column("heightfield, today", "local", "heightfield"),
    Column("heightfield, one of 100", "update", "heightfield"),
)
MAPS = [Column(name, "search_map", method) for method, name in SEARCHES.items() if method != "ray_cast"]
TABLE_5 = [
    Column(f"{method.replace('_bfs', ' BFS')}", "collect", method, reported)
    for method, reported in report.COLLECT.items()
]
TABLE_6 = (
    Column("Simple-Mesh", "simple", "physx", report.FINAL_SIMPLE),
    Column("general", "smart", "general", report.FINAL_GENERAL),
    Column("uniform", "smart", "heightfield", report.FINAL_UNIFORM),
)
GENERAL = (
    Column("update, brute force, cached topology", "general", "brute_force cached", {SIDE: report.FINAL_GENERAL[SIDE]}),
    Column("update, brute force, triangles found anew", "general", "brute_force union_bfs", {}),
    Column("update, best-first, cached topology", "general", "best_first cached", {}),
    Column("update, best-first, triangles found anew", "general", "best_first union_bfs", {}),
    Column("taking in all vertices", "ingest", "mesh", {SIDE: 6.0}),
)


def table_4(bench: Bench) -> str:
    """The searches at the report's sizes."""
    rows = [
        [name, f"{side}x{side}", *Column(name, "search", method, report.SEARCH[method]).cells(bench, side)]
        for method, name in SEARCHES.items()
        for side in report.SEARCH[method]
    ]
    return table(["search", "main mesh", "report", "today", RATIO], rows)


def table_6(bench: Bench) -> str:
    """The final comparison."""
    rows = []
    for side in (*report.FINAL_SIMPLE, *report.LARGER):
        trimesh, uniform = (bench.us(*case, side=side) for case in (TABLE_1[1][1:3], TABLE_6[2][1:3]))
        ratios = [times(trimesh / uniform), times(trimesh / update_per_body(bench, 1))]
        rows.append([f"{side}x{side}", *(cell for one in TABLE_6 for cell in one.cells(bench, side)), *ratios])
    ratios = ["PyBullet trimesh / uniform", "PyBullet trimesh / uniform, one of 100"]
    return table(["main mesh", *(title for one in TABLE_6 for title in one.head()), *ratios], rows)


def all_tables(bench: Bench) -> str:
    """Every table, under its heading."""
    note = f"\n- = the engine does not take so large a map, or a frame would take longer than {LONGEST_FRAME:g} s."
    general = [[one.title, *one.cells(bench, SIDE)] for one in GENERAL]
    sides = (25, 50, 100, 200, *report.LARGER)
    parts = {
        "Table 1: collider of the whole main mesh [ms]": by_side(bench, "main mesh", report.SIMPLE_PHYSX, *TABLE_1),
        "Beyond Table 1: other ways to keep a collider of the whole map, and larger maps [ms]":
            by_side(bench, "main mesh", WHOLE, *SIMPLE) + note,
        "Table 2: one local collider of 3x3 by main mesh [ms]": by_side(bench, "main mesh", sides, *TABLE_2),
        "Table 3: one local collider by its size, main mesh 200x200 [ms]": by_rings(bench, *TABLE_3),
        "Table 4: nearest-vertex search, one body [ms]": table_4(bench),
        "Beyond Table 4: one body on a height map, through the code that serves batches [ms]":
            by_side(bench, "height map", MAP_SIDES, *MAPS),
        "Table 5: collecting the vertices of one local collider [ms]": by_rings(bench, *TABLE_5),
        "Table 6: everything for one body [ms]": table_6(bench),
        "General mesh of 40,000 vertices, all moving, one body [ms]": table(["", "report", "today", RATIO], general),
        "Left out": "\n".join(f"- {what}: {why}" for what, why in bench.left_out.items()),
    }  # fmt: skip
    return "\n".join(f"### {heading}\n\n{body}\n" for heading, body in parts.items() if body)
