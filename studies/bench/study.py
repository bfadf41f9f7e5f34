"""``make bench``: measures the report's tables again, and further ones, and fills docs/benchmarks.md."""

import math
import os
from collections.abc import Mapping
from typing import NamedTuple

from studies.bench import report, searching, smart_mesh
from studies.bench.measure import LONGEST_FRAME, Bench
from studies.bench.searching import MAP_SIDES
from studies.bench.smart_mesh import BATCH, SIDE
from studies.pages import ROOT, fill, measured_on, number, save, say, table, times

# Above one: today is faster.
RATIO = "report / today"
PAGE, RESULTS = (ROOT / "docs" / f"benchmarks{suffix}" for suffix in (".md", ".json"))


def measure(bench: Bench) -> None:
    """Run all parts."""
    for name in (*smart_mesh.ENGINES, *smart_mesh.COAL):
        say(f"whole mesh, {name}")
        smart_mesh.measure_whole(bench, name)
    for side in bench.some(smart_mesh.SIDES):
        say(f"patch on {side}x{side}")
        smart_mesh.measure_main_meshes(bench, side)
    smart_mesh.measure_local_colliders(bench)
    for side in bench.some(searching.REPORT_SIDES):
        say(f"searches on {side}x{side}")
        searching.measure_general(bench, side)
    for side in bench.some(MAP_SIDES):
        say(f"searches on a map of {side}x{side}")
        searching.measure_maps(bench, side)
    searching.measure_collecting(bench)
    smart_mesh.measure_general(bench)


def main() -> None:
    """Measure, print the tables, and write JSON and the page."""
    measure(bench := Bench())
    frames = [found[-1] for found in bench.found.values()]
    text = (
        f"{measured_on()}, under a load of {os.getloadavg()[1]:.1f} (this bench alone: about 1). Medians of "
        f"{max(frames)} frames; of as few as {min(frames)} where a frame takes long.\n\n{all_tables(bench)}"
    )
    print(f"\n{text}")
    times_us = {" ".join(map(str, case)): found for case, found in bench.found.items()}
    save(RESULTS, {"machine": measured_on(), "left_out": bench.left_out, "times_us": times_us})
    fill(PAGE, {"tables": text})


SEARCHES = {
    method: method.replace("_worst", ", worst").replace("best_", "best-").replace("_", " ") for method in report.SEARCH
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

    def ms(self, bench: Bench, size: int) -> float:
        """Return today's time, that of a batch for one of its bodies."""
        return bench.us(self.what, self.method, size) / 1e3 / (BATCH if self.what == "update" else 1)

    def cells(self, bench: Bench, size: int) -> list[str]:
        """Return its cells for a main mesh or a collider of a ``size``."""
        today = self.ms(bench, size)
        if self.reported is None:
            return [number(today)]
        known = self.reported.get(size, math.nan)
        return [number(known), number(today), times(known / today)]


def by(bench: Bench, first: str, sizes: Mapping[str, int], *columns: Column) -> str:
    """Return a table with a row for each of the ``sizes``, by what they are called."""
    rows = [[name, *(cell for one in columns for cell in one.cells(bench, size))] for name, size in sizes.items()]
    return table([first, *(title for one in columns for title in one.head())], rows)


def squares(*sides: int) -> dict[str, int]:
    """Return sizes of main meshes by what they are called."""
    return {f"{side}x{side}": side for side in sides}


COLLIDERS = {f"{2 * rings + 1}x{2 * rings + 1}": rings for rings in report.RINGS}
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
    for name, side in squares(*report.FINAL_SIMPLE, *report.LARGER).items():
        trimesh, uniform, shared = (
            one.ms(bench, size) for one, size in ((TABLE_1[1], side), (TABLE_6[2], side), (TABLE_3[3], 1))
        )
        ratios = [times(trimesh / uniform), times(trimesh / shared)]
        rows.append([name, *(cell for one in TABLE_6 for cell in one.cells(bench, side)), *ratios])
    ratios = ["PyBullet trimesh / uniform", "PyBullet trimesh / uniform, one of 100"]
    return table(["main mesh", *(title for one in TABLE_6 for title in one.head()), *ratios], rows)


def all_tables(bench: Bench) -> str:
    """Every table, under its heading."""
    note = f"\n- = the engine does not take so large a map, or a frame would take longer than {LONGEST_FRAME:g} s."
    general = [[one.title, *one.cells(bench, SIDE)] for one in GENERAL]
    report_sides, larger = report.SIMPLE_PHYSX, report.LARGER
    parts = {
        "Table 1: collider of the whole main mesh [ms]": by(bench, "main mesh", squares(*report_sides), *TABLE_1),
        "Beyond Table 1: other ways to keep a collider of the whole map, and larger maps [ms]":
            by(bench, "main mesh", squares(*report_sides, *larger), *SIMPLE) + note,
        "Table 2: one local collider of 3x3 by main mesh [ms]": by(
            bench, "main mesh", squares(25, 50, 100, 200, *larger), *TABLE_2
        ),
        "Table 3: one local collider by its size, main mesh 200x200 [ms]": by(bench, "collider", COLLIDERS, *TABLE_3),
        "Table 4: nearest-vertex search, one body [ms]": table_4(bench),
        "Beyond Table 4: one body on a height map, through the code that serves batches [ms]":
            by(bench, "height map", squares(*MAP_SIDES), *MAPS),
        "Table 5: collecting the vertices of one local collider [ms]": by(bench, "collider", COLLIDERS, *TABLE_5),
        "Table 6: everything for one body [ms]": table_6(bench),
        "General mesh of 40,000 vertices, all moving, one body [ms]": table(["", "report", "today", RATIO], general),
        "Left out": "\n".join(f"- {what}: {why}" for what, why in bench.left_out.items()),
    }  # fmt: skip
    return "\n".join(f"### {heading}\n\n{body}\n" for heading, body in parts.items() if body)
