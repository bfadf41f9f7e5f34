"""Functions that take maps refuse arguments with which they would read or write outside an array."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.motion import CLOCK, INTERVALS_KEPT, KEPT
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.core.array_arguments import FEWER, Arguments, Entry
from tests.core.test_bindings import REFUSED

ROWS, COLUMNS = 70, 130


def clock_bytes(*shape: int) -> np.ndarray:
    return np.zeros(shape, CLOCK).view(np.uint8).reshape(*shape, CLOCK.itemsize)


def floats(*shape: int) -> np.ndarray:
    return np.zeros(shape, np.float32)


def rectangles() -> Arguments:
    return {
        "heights": floats(ROWS, COLUMNS), "velocities": floats(KEPT, ROWS, COLUMNS), "clocks": clock_bytes(2, 3),
        "rectangles": np.array([[0, 0, 1, 2], [68, 127, 69, 129]]), "fresh": floats(12), "given": floats(12),
        "time": 0.1, "intervals": (0.004, 0.25),
    }  # fmt: skip


def correction() -> Arguments:
    return {
        "heights": floats(ROWS, COLUMNS), "offsets": floats(ROWS, COLUMNS), "clocks": clock_bytes(2, 3),
        "first": (67, 126), "known": floats(3, 4), "time": 0.1, "shown": 0.1, "settle": 0.2,
    }  # fmt: skip


def fusion() -> Arguments:
    return {
        "heights": floats(ROWS, COLUMNS), "variances": floats(ROWS, COLUMNS), "first": (67, 126),
        "measured": floats(3, 4), "noises": floats(3, 4), "grown": 0.0, "gate_squared": 25.0,
    }  # fmt: skip


def update() -> Arguments:
    return {"clock": clock_bytes(1), "time": 0.1, "given": False, "whole": True, "intervals": (0.004, 0.25)}


def vertices() -> Arguments:
    places = np.stack([*np.divmod(np.arange(12), 4), np.zeros(12)], axis=1)
    mesh = TriangleMesh(places, grid_triangles(3, 4))
    return {
        "mesh": mesh.core_reader, "indices": np.arange(12), "time": 0.1, "ahead": 0.1, "positions": np.zeros((12, 3)),
        "velocities": np.zeros((12, 3)),
    }  # fmt: skip


def lattice() -> Arguments:
    return {
        "cells": np.zeros((8, 14, 2), np.int64), "last": np.zeros((8, 14, 3)), "steps": np.zeros((8, 14)),
        "stride": (10, 10), "heights": floats(ROWS, COLUMNS), "z": 0.0, "first": (5, -7), "least": 0.001,
    }  # fmt: skip


ENTRIES = {
    "take_rectangles": Entry(CORE.take_rectangles, rectangles),
    "take_corrected": Entry(CORE.take_corrected, correction),
    "fuse": Entry(CORE.fuse, fusion),
    "note_update": Entry(CORE.note_update, update),
    "sample_mesh": Entry(CORE.sample_mesh, vertices),
    "compare_maps": Entry(CORE.compare_maps, lattice),
    "moved_as_one": Entry(CORE.moved_as_one, lattice),
}
# Spoilt arrays that may be given.
ALLOWED = {
    *(("take_rectangles", "given", how) for how in ("empty", "empty rows")),
    *(("take_corrected", "known", how) for how in ("one row fewer", "one column fewer")),
    ("note_update", "clock", "reversed"),
    *((entry, "heights", how) for entry in ("compare_maps", "moved_as_one") for how in FEWER),
}  # fmt: skip


# Arrays that are written to.
WRITTEN = [
    *(("take_rectangles", name) for name in ("heights", "velocities", "clocks")),
    *(("take_corrected", name) for name in ("heights", "offsets", "clocks")),
    *(("fuse", name) for name in ("heights", "variances")),
    ("note_update", "clock"),
    *(("sample_mesh", name) for name in ("positions", "velocities")),
    *(("compare_maps", name) for name in ("cells", "last", "steps")),
]


@pytest.mark.parametrize(
    "entry, name, value",
    [
        *(
            ("take_rectangles", "rectangles", np.array([place, [0, 0, 0, 5]]))
            for place in (
                [-1, 0, -1, 5], [0, -1, 0, 4], [70, 0, 70, 5], [0, 125, 0, 130], [0, 5, 0, 0], [5, 0, 0, 5],
                [0, 0, 2**62, 5], [0, 0, 0, 2**63 - 1], [-(2**63), 0, 0, 5],
            )
        ),
        *(
            (entry, "first", place)
            for entry in ("take_corrected", "fuse")
            for place in ((-1, 0), (0, -1), (68, 0), (0, 127), (2**62, 0), (0, 2**63 - 1), (-(2**63), 0), (2**64, 0))
        ),
        *(("sample_mesh", "indices", np.r_[np.arange(11), wrong]) for wrong in (-1, 12, 2**31, 2**63 - 1, -(2**63))),
        *((entry, "time", np.nan) for entry in ("take_rectangles", "take_corrected", "note_update")),
        ("take_corrected", "shown", np.nan), ("take_corrected", "settle", 0.0), ("take_corrected", "settle", np.nan),
        *(
            (entry, "stride", stride)
            for entry in ("compare_maps", "moved_as_one")
            for stride in ((0, 1), (1, 0), (-1, 1), (2**62, 1), (1, 2**62))
        ),
        *(
            (entry, "first", place)
            for entry in ("compare_maps", "moved_as_one")
            for place in ((2**63 - 1, 0), (0, -(2**63)), (2**53, 0))
        ),
    ],
)  # fmt: skip
def test_numbers_that_lead_out_of_an_array_are_refused(entry: str, name: str, value: Any) -> None:
    with pytest.raises(REFUSED):
        ENTRIES[entry].function(**ENTRIES[entry].made() | {name: value})


@pytest.mark.parametrize(
    "field, value",
    [
        ("newest", -1),
        ("newest", KEPT),
        ("newest", 2**62),
        ("count", -1),
        ("count", INTERVALS_KEPT + 1),
        ("count", 2**62),
    ],
)
@pytest.mark.parametrize(
    "entry, name", [("take_rectangles", "clocks"), ("take_corrected", "clocks"), ("note_update", "clock")]
)
def test_clocks_that_lead_out_of_an_array_are_refused(entry: str, name: str, field: str, value: int) -> None:
    given = ENTRIES[entry].made()
    given[name].view(CLOCK)[field] = value
    with pytest.raises(REFUSED):
        ENTRIES[entry].function(**given)


@pytest.mark.parametrize("newest", (-1, KEPT, 2**62, -(2**63)))
def test_a_mesh_whose_clock_names_no_velocity_is_at_rest(newest: int) -> None:
    mesh = TriangleMesh(np.eye(3), [[0, 1, 2]], velocities=np.ones((3, 3)))
    mesh._clocks["newest"] = newest
    assert not mesh.sample(np.arange(3), 0.1).velocities.any()


@pytest.mark.parametrize("cell", (2**40, 2**63 - 1, -(2**63)))
def test_lattice_points_that_are_too_far_away_are_unknown(cell: int) -> None:
    given = lattice()
    given["cells"][...] = cell
    assert not CORE.moved_as_one(**given)


def test_a_lattice_may_be_smaller_than_the_map() -> None:
    given = lattice() | {"stride": (1, 1)}
    counts, _ = CORE.compare_maps(**given)
    assert counts[0] <= ROWS * COLUMNS
