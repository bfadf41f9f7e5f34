"""Runs the matrix."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Sequence

from smartmesh_ros.errors import InputError
from studies.matrix import changes, moving_ground, real_maps, rules, sleeping, still_ground, touching, uneven_maps
from studies.matrix.row import METHODS, Outcome, Row

_PARTS = (still_ground, moving_ground, changes, rules, touching, real_maps, uneven_maps, sleeping)
ROWS: tuple[Row, ...] = tuple(row for part in _PARTS for row in part.ROWS)
QUICK_METHODS = ("defaults", "rebuilt trimesh")


def run_cell(row: Row, method: str) -> Outcome:
    """One row for one method."""
    figure: float | None = None
    if method not in row.skip:
        try:
            figure = float(row.figure(METHODS[method]))
        except InputError:  # the method cannot do it
            figure = math.inf
    return Outcome(row=row.name, method=method, figure=figure, limit=row.limit, unit=row.unit, source=row.source)


def run_matrix(say: Callable[[str], None], *, quick: bool = False, methods: Sequence[str] = ()) -> list[Outcome]:
    """All cells, row by row, or those of some ``methods``; the quick run has fewer rows and methods.

    Each cell runs in a process of its own, on all cores: PyBullet keeps the memory of every mesh that was replaced,
    gigabytes in a row of moving whole meshes.
    """
    chosen = tuple(methods) or (QUICK_METHODS if quick else tuple(METHODS))
    cells = [(number, method) for number, row in enumerate(ROWS) if row.quick or not quick for method in chosen]
    outcomes = []
    with multiprocessing.get_context("fork").Pool(maxtasksperchild=1) as pool:
        for outcome in pool.imap(_run_numbered, cells):
            outcomes.append(outcome)
            say(f"stability: {outcome.row}, {outcome.method}")
    return outcomes


def _run_numbered(cell: tuple[int, str]) -> Outcome:
    """Run a cell by the number of its row: functions of rows cannot be sent to another process."""
    number, method = cell
    return run_cell(ROWS[number], method)
