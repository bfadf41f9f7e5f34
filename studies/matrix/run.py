"""Runs the matrix."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from smartmesh_ros.errors import InputError
from studies.matrix import (
    changes,
    edges,
    mapper_drive,
    moving_ground,
    real_maps,
    rules,
    sleeping,
    still_ground,
    touching,
    uneven_maps,
)
from studies.matrix.row import METHODS, Outcome, Row

ROWS: tuple[Row, ...] = (
    *still_ground.ROWS,
    *moving_ground.ROWS,
    *changes.ROWS,
    *rules.ROWS,
    *touching.ROWS,
    *edges.ROWS,
    *real_maps.ROWS,
    *uneven_maps.ROWS,
    *mapper_drive.ROWS,
    *sleeping.ROWS,
)
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
    """All cells, row by row, or those of some ``methods``; the quick run has fewer rows and methods."""
    chosen = tuple(methods) or (QUICK_METHODS if quick else tuple(METHODS))
    outcomes = []
    for row in ROWS:
        if row.quick or not quick:
            for method in chosen:
                say(f"stability: {row.name}, {method}")
                outcomes.append(run_cell(row, method))
    return outcomes
