"""All tables of a run: the report's tables, and further ones."""

from __future__ import annotations

import math

from studies.bench import report, searching
from studies.bench.measure import LONGEST_FRAME, Results
from studies.bench.smart_mesh import BATCH, BATCH_SIDE, SIDE
from studies.markdown import RATIO, beside, number, size, table, times

SEARCHES = {
    "brute_force": "brute force",
    "ray_cast": "ray cast",
    "best_first": "best-first",
    "best_first_worst": "best-first, worst",
    "grid_traversal": "grid traversal",
    "grid_traversal_worst": "grid traversal, worst",
}


def update_per_body(results: Results, rings: int) -> float:
    """Update of a heightfield patch in a batch, all in, per body [us]."""
    return results.us("update", "heightfield", side=BATCH_SIDE, bodies=BATCH, rings=rings) / BATCH


def head(first: str, *methods: str) -> list[str]:
    """Return the heading of a table of `beside` for each of the methods, behind a ``first`` column."""
    return [first, *(cell for method in methods for cell in (f"{method}, report", "today", RATIO))]


def table_1(results: Results) -> str:
    """Simple-Mesh in the report's engines."""
    rows = [
        [
            size(side),
            *beside(report.SIMPLE_PHYSX[side], results.ms("simple", "physx", side=side)),
            *beside(report.SIMPLE_BULLET[side], results.ms("simple", "bullet_trimesh", side=side)),
        ]
        for side in report.SIMPLE_PHYSX
    ]
    return table([*head("main mesh", "PhysX"), "Bullet (refit), report", "PyBullet (anew), today", RATIO], rows)


def table_2(results: Results) -> str:
    """The local collider by the size of the main mesh."""
    rows = [
        [
            size(side),
            *beside(report.SMART_PHYSX.get(side, math.nan), results.ms("smart", "physx", side=side)),
            *beside(report.SMART_BULLET.get(side, math.nan), results.ms("smart", "trimesh", side=side)),
            number(results.ms("smart", "heightfield", side=side)),
        ]
        for side in (*report.SMART_BULLET, 200, *report.LARGER)
    ]
    return table([*head("main mesh", "PhysX", "Bullet trimesh"), "heightfield replaced, today"], rows)


def table_3(results: Results) -> str:
    """The local collider by its own size."""
    rows = [
        [
            size(2 * rings + 1),
            *beside(report.LOCAL_VARYING[rings], results.ms("local", "varying", side=200, rings=rings)),
            *beside(report.LOCAL_CONSTANT[rings], results.ms("local", "constant", side=200, rings=rings)),
            number(results.ms("local", "heightfield", side=200, rings=rings)),
            number(update_per_body(results, rings) / 1e3),
        ]
        for rings in report.RINGS
    ]
    return table([*head("collider", "varying", "constant"), "heightfield, today", "heightfield, one of 100"], rows)


def table_4(results: Results) -> str:
    """The searches at the report's sizes."""
    rows = [
        [name, size(side), *beside(reported, results.ms("search", method, side=side))]
        for method, name in SEARCHES.items()
        for side, reported in report.SEARCH[method].items()
    ]
    return table(["search", "main mesh", "report", "today", RATIO], rows)


def table_5(results: Results) -> str:
    """Collecting."""
    rows = []
    for rings in report.RINGS:
        cells = [size(2 * rings + 1)]
        for method, reported in report.COLLECT.items():
            cells += beside(reported[rings], results.ms("collect", method, side=200, rings=rings))
        rows.append(cells)
    return table(head("collider", "queue BFS", "union BFS", "cached"), rows)


def table_6(results: Results) -> str:
    """The final comparison."""
    rows = []
    for side in (*report.FINAL_SIMPLE, *report.LARGER):
        uniform = results.ms("smart", "heightfield", side=side)
        trimesh = results.us("simple", "bullet_trimesh", side=side)
        rows.append(
            [
                size(side),
                *beside(report.FINAL_SIMPLE.get(side, math.nan), results.ms("simple", "physx", side=side)),
                *beside(report.FINAL_GENERAL.get(side, math.nan), results.ms("smart", "general", side=side)),
                *beside(report.FINAL_UNIFORM.get(side, math.nan), uniform),
                times(trimesh / uniform / 1e3),
                times(trimesh / update_per_body(results, 1)),
            ]
        )
    ratios = "PyBullet trimesh / uniform", "PyBullet trimesh / uniform, one of 100"
    return table([*head("main mesh", "Simple-Mesh", "general", "uniform"), *ratios], rows)


SIMPLE = {
    "physx": "PhysX, cooked",
    "bullet_trimesh": "PyBullet trimesh, built anew",
    "bullet_heightfield": "PyBullet heightfield, replaced",
    "coal_rebuild": "coal BVH, built anew",
    "coal_refit": "coal BVH, refitted",
    "coal_heightfield": "coal heights, updated",
    "mujoco": "MuJoCo, written",
}


def all_tables(results: Results) -> str:
    """Every table, under its heading."""
    parts = (
        ("Table 1: collider of the whole main mesh [ms]", table_1(results)),
        ("Beyond Table 1: other ways to keep a collider of the whole map, and larger maps [ms]", larger_maps(results)),
        ("Table 2: one local collider of 3x3 by main mesh [ms]", table_2(results)),
        ("Table 3: one local collider by its size, main mesh 200x200 [ms]", table_3(results)),
        ("Table 4: nearest-vertex search, one body [ms]", table_4(results)),
        ("Beyond Table 4: one body on a height map, through the code that serves batches [ms]", map_searches(results)),
        ("Table 5: collecting the vertices of one local collider [ms]", table_5(results)),
        ("Table 6: everything for one body [ms]", table_6(results)),
        ("General mesh of 40,000 vertices, all moving, one body [ms]", general(results)),
        ("Left out", left_out(results)),
    )
    return "\n".join(f"### {heading}\n\n{body}\n" for heading, body in parts if body)


def larger_maps(results: Results) -> str:
    """Every way to keep a collider of the whole map."""
    rows = [
        [size(side), *(number(results.ms("simple", method, side=side)) for method in SIMPLE)]
        for side in (*report.SIMPLE_PHYSX, *report.LARGER)
    ]
    note = f"\n- = the engine does not take so large a map, or a frame would take longer than {LONGEST_FRAME:g} s."
    return table(["main mesh", *SIMPLE.values()], rows) + note


def map_searches(results: Results) -> str:
    """The searches on height maps."""
    methods = [method for method in SEARCHES if method != "ray_cast"]
    rows = [
        [size(side), *(number(results.ms("search_map", method, side=side)) for method in methods)]
        for side in searching.MAP_SIDES
    ]
    return table(["height map", *(SEARCHES[method] for method in methods)], rows)


def general(results: Results) -> str:
    """The general mesh."""
    rows = [
        [f"update, {name}", *beside(known, results.ms("general", method, side=SIDE))]
        for method, name, known in (
            ("brute_force cached", "brute force, cached topology", report.FINAL_GENERAL[SIDE]),
            ("brute_force union_bfs", "brute force, triangles found anew", math.nan),
            ("best_first cached", "best-first, cached topology", math.nan),
            ("best_first union_bfs", "best-first, triangles found anew", math.nan),
        )
    ]
    rows.append(["taking in all vertices", *beside(6.0, results.ms("ingest", "mesh", side=SIDE))])
    return table(["", "report", "today", RATIO], rows)


def left_out(results: Results) -> str:
    """Return the cases that were not measured, and the reasons."""
    return "\n".join(f"- {what}: {why}" for what, why in results.left_out.items())
