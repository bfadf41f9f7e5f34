"""The report's tables: its figures beside today's, and their ratio."""

from __future__ import annotations

import math

from studies.bench import crowds, report
from studies.bench.measure import Results
from studies.markdown import RATIO, beside, number, size, table, times

SEARCHES = {
    "brute_force": "brute force",
    "ray_cast": "ray cast",
    "best_first": "best-first",
    "best_first_worst": "best-first, worst",
    "grid_traversal": "grid traversal",
    "grid_traversal_worst": "grid traversal, worst",
}


def update_per_body(results: Results, rings: int, count: int = crowds.BATCH) -> float:
    """Update of a heightfield patch in a batch, all in, per body [us]."""
    return results.us("update", "heightfield", side=crowds.SIDE, bodies=count, rings=rings) / count


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
    return table(
        ["main mesh", "PhysX, report", "today", RATIO, "Bullet (refit), report", "PyBullet (anew), today", RATIO], rows
    )


def table_2(results: Results) -> str:
    """The local collider by the size of the main mesh."""
    rows = []
    for side in (*report.SMART_BULLET, 200, *report.LARGER):
        physx, bullet = report.SMART_PHYSX.get(side, math.nan), report.SMART_BULLET.get(side, math.nan)
        rows.append(
            [
                size(side),
                *beside(physx, results.ms("smart", "physx", side=side)),
                *beside(bullet, results.ms("smart", "trimesh", side=side)),
                number(results.ms("smart", "heightfield", side=side)),
            ]
        )
    return table(
        [
            "main mesh", "PhysX, report", "today", RATIO, "Bullet trimesh, report", "today", RATIO,
            "heightfield replaced, today",
        ],
        rows,
    )  # fmt: skip


def table_3(results: Results) -> str:
    """The local collider by its own size."""
    rows = []
    for rings in report.RINGS:
        today = {
            method: results.ms("local", method, side=200, rings=rings)
            for method in ("varying", "constant", "heightfield")
        }
        rows.append(
            [
                size(2 * rings + 1),
                *beside(report.LOCAL_VARYING[rings], today["varying"]),
                *beside(report.LOCAL_CONSTANT[rings], today["constant"]),
                number(today["heightfield"]),
                number(update_per_body(results, rings) / 1e3),
            ]
        )
    return table(
        [
            "collider", "varying, report", "today", RATIO, "constant, report", "today", RATIO,
            "heightfield, today", "heightfield, one of 100",
        ],
        rows,
    )  # fmt: skip


def table_4(results: Results) -> str:
    """The searches at the report's sizes."""
    rows = []
    for method, name in SEARCHES.items():
        for side, reported in report.SEARCH[method].items():
            rows.append([name, size(side), *beside(reported, results.ms("search", method, side=side))])
    return table(["search", "main mesh", "report", "today", RATIO], rows)


def table_5(results: Results) -> str:
    """Collecting."""
    rows = []
    for rings in report.RINGS:
        cells = [size(2 * rings + 1)]
        for method, reported in report.COLLECT.items():
            cells += beside(reported[rings], results.ms("collect", method, side=200, rings=rings))
        rows.append(cells)
    return table(
        [
            "collider", "queue BFS, report", "today", RATIO, "union BFS, report", "today", RATIO,
            "cached, report", "today", RATIO,
        ],
        rows,
    )  # fmt: skip


def table_6(results: Results) -> str:
    """The final comparison."""
    rows = []
    for side in (*report.FINAL_SIMPLE, *report.LARGER):
        simple = results.ms("simple", "physx", side=side)
        uniform = results.ms("smart", "heightfield", side=side)
        trimesh = results.us("simple", "bullet_trimesh", side=side)
        rows.append(
            [
                size(side),
                *beside(report.FINAL_SIMPLE.get(side, math.nan), simple),
                *beside(report.FINAL_GENERAL.get(side, math.nan), results.ms("smart", "general", side=side)),
                *beside(report.FINAL_UNIFORM.get(side, math.nan), uniform),
                times(trimesh / uniform / 1e3),
                times(trimesh / update_per_body(results, 1)),
            ]
        )
    return table(
        [
            "main mesh", "Simple-Mesh, report", "today", RATIO, "general, report", "today", RATIO,
            "uniform, report", "today", RATIO, "PyBullet trimesh / uniform", "PyBullet trimesh / uniform, one of 100",
        ],
        rows,
    )  # fmt: skip
