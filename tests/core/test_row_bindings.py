"""Functions on tables of bodies refuse arguments with which they would read or write outside an array."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smartmesh_ros import HeightMap
from smartmesh_ros.core import CORE
from smartmesh_ros.ground.shapes import DIMENSIONS
from smartmesh_ros.patches.shapes import SHAPE
from smartmesh_ros.world.state_table import LIMITS
from tests.core.array_arguments import FEWER, Arguments, Entry, arrays_of
from tests.core.test_bindings import REFUSED

SLOTS = 8


def slots() -> np.ndarray:
    return np.array([7, 0, 3])


def zeros(columns: int, rows: int = SLOTS) -> np.ndarray:
    return np.zeros((rows, columns))


def flags() -> np.ndarray:
    return np.ones(SLOTS, bool)


def shape_bytes() -> np.ndarray:
    return np.zeros(SLOTS, SHAPE).view(np.uint8).reshape(SLOTS, SHAPE.itemsize)


def motion() -> Arguments:
    return {
        "chosen": slots(), "shapes": shape_bytes(), "states": zeros(13), "boxes": zeros(6), "anchors": zeros(8),
        "time": 0.1, "distance": 0.001,
    }  # fmt: skip


def island() -> Arguments:
    owners = np.arange(SLOTS)
    return {
        "chosen": slots(), "owners": owners, "boxes": zeros(6), "radii": np.ones(SLOTS), "near": 0.1, "share": 0.1,
    }  # fmt: skip


def asleep() -> Arguments:
    return {"asleep": slots(), "boxes": zeros(6), "radii": np.ones(SLOTS), "near": 0.1, "share": 0.1}


def reached() -> Arguments:
    return {
        "movers": np.array([1, 2]), "states": zeros(13), "positions": zeros(3), "moved": zeros(3), "anchors": zeros(8),
        "stillness": (1.0, 0.5, 0.001), "elapsed": 0.01, "found": np.zeros(SLOTS, bool),
    }  # fmt: skip


def under() -> Arguments:
    ground = HeightMap(np.zeros((70, 130)), resolution=0.1)
    boxes = np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], (SLOTS, 1))
    return {
        "map": ground.core_reader, "time": 0.1, "chosen": slots(), "boxes": boxes, "counts": np.zeros(3, np.int64),
    }  # fmt: skip


def near_any(
    states: Any, radii: Any, margins: Any, places: Any, speeds: Any, others: Any, own: Any, **rest: Any
) -> Any:
    return CORE.near_any((states, radii, margins), rest["duration"], (places, speeds, others, own), rest["horizon"])


ENTRIES = {
    "note_motion": Entry(CORE.note_motion, motion),
    "islands": Entry(CORE.islands, island),
    "Sleepers": Entry(CORE.Sleepers, asleep),
    "mark_near": Entry(
        CORE.Sleepers(**asleep()).mark_near, lambda: {"slot": 1, "found": np.zeros(SLOTS, bool)}
    ),
    "mark_connected": Entry(CORE.Sleepers(**asleep()).mark_connected, lambda: {"found": np.zeros(SLOTS, bool)}),
    "mark_reached": Entry(CORE.Sleepers(**asleep()).mark_reached, reached),
    "strayed": Entry(
        CORE.strayed, lambda: {"state": np.zeros(13), "anchor": np.zeros(7), "radius": 1.0}
    ),
    "count_updates": Entry(CORE.count_updates, under),
    "samples_under": Entry(CORE.samples_under, under),
    "first_fault": Entry(
        CORE.first_fault,
        lambda: {
            "states": zeros(13), "radii": np.ones(SLOTS), "kinds": np.ones(SLOTS, np.uint8), "dimensions": zeros(3),
            "centres": zeros(3), "masses": np.ones(SLOTS), "limits": LIMITS,
        },
    ),
    "extrapolated": Entry(CORE.extrapolated, lambda: {"states": zeros(13), "duration": 0.1}),
    "blended": Entry(CORE.blended, lambda: {"states": zeros(13), "targets": zeros(13), "share": 0.5}),
    "near_any": Entry(
        near_any,
        lambda: {
            "states": zeros(13, 4), "radii": np.ones(4), "margins": np.ones(4), "places": zeros(3), "speeds": zeros(3),
            "others": np.ones(SLOTS), "own": flags(), "duration": 0.1, "horizon": 0.1,
        },
    ),
    "may_touch": Entry(
        CORE.may_touch,
        lambda: {
            "positions": zeros(3), "moved": zeros(3), "radii": np.ones(SLOTS), "guests": flags(), "solid": flags(),
            "slack": 0.1,
        },
    ),
    "may_meet": Entry(
        CORE.may_meet,
        lambda: {"origins": zeros(3), "ways": zeros(3) + 1.0, "reach": np.ones(SLOTS), "boxes": zeros(6, 20)},
    ),
    "split_bodies": Entry(
        CORE.split_bodies,
        lambda: {"content": np.ones(500, np.uint8), "at": 0, "rows": np.zeros((3, 140), np.uint8)},
    ),
}  # fmt: skip
# Spoilt arrays that may be given.
ALLOWED = {
    *((entry, "chosen", how) for entry in ("note_motion", "islands") for how in FEWER),
    *(("Sleepers", "asleep", how) for how in FEWER),
    *(("mark_reached", "movers", how) for how in FEWER),
    *(("extrapolated", "states", how) for how in ("one row fewer", "empty")),
    *(("may_meet", "boxes", how) for how in ("one row fewer", "empty")),
    *(("split_bodies", "content", how) for how in (*FEWER, "misaligned")),
    *(("split_bodies", "rows", how) for how in FEWER),
    ("first_fault", "kinds", "misaligned"),
    ("near_any", "own", "misaligned"), ("may_touch", "guests", "misaligned"), ("may_touch", "solid", "misaligned"),
}  # fmt: skip


# Arrays that are written to.
WRITTEN = [
    ("note_motion", "boxes"), ("note_motion", "anchors"), ("mark_near", "found"), ("mark_connected", "found"),
    ("mark_reached", "found"), ("count_updates", "counts"), ("samples_under", "counts"),
    ("split_bodies", "rows"),
]  # fmt: skip


@pytest.mark.parametrize("wrong", (-1, SLOTS, 2**31, 2**63 - 1, -(2**63)))
@pytest.mark.parametrize(
    "entry, name",
    [
        ("note_motion", "chosen"), ("islands", "chosen"), ("Sleepers", "asleep"), ("mark_reached", "movers"),
        ("count_updates", "chosen"), ("samples_under", "chosen"),
    ],
)  # fmt: skip
def test_slots_that_are_in_no_table_are_refused(entry: str, name: str, wrong: int) -> None:
    given = ENTRIES[entry].made()
    given[name][-1] = wrong
    with pytest.raises(REFUSED):
        ENTRIES[entry].function(**given)


@pytest.mark.parametrize("slot", (-1, SLOTS, 2**31, 2**63 - 1, -(2**63), 2**64))
def test_a_slot_that_is_in_no_table_is_refused(slot: int) -> None:
    with pytest.raises(REFUSED):
        CORE.Sleepers(**asleep()).mark_near(slot, np.zeros(SLOTS, bool))


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e300))
@pytest.mark.parametrize("entry, name", [pair for pair in arrays_of(ENTRIES) if pair[0] != "may_meet"])
def test_numbers_that_are_not_possible_do_no_harm(entry: str, name: str, value: float) -> None:
    given = ENTRIES[entry].made()
    if given[name].dtype != np.float64:
        return
    given[name][...] = value
    ENTRIES[entry].function(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e300))
@pytest.mark.parametrize("name", ("origins", "ways", "reach", "boxes"))
def test_rays_of_impossible_numbers_do_no_harm(name: str, value: float) -> None:
    given = ENTRIES["may_meet"].made()
    given[name][...] = value
    try:
        CORE.may_meet(**given)
    except REFUSED:
        assert name == "boxes"


@pytest.mark.parametrize("kind", (0, len(DIMENSIONS), 255))
def test_bodies_of_no_known_kind_are_faulty(kind: int) -> None:
    given = ENTRIES["first_fault"].made()
    given["states"][:, 6], given["kinds"][3] = 1.0, kind
    given["dimensions"][...] = 1.0
    assert CORE.first_fault(**given) == (3, 5)


@pytest.mark.parametrize("counts", (np.zeros(4, np.int64), np.full(5, 2**62), np.full(5, -1), np.zeros(5), None))
def test_numbers_of_dimensions_lead_out_of_no_array(counts: Any) -> None:
    given = ENTRIES["first_fault"].made()
    given["states"][:, 6] = 1.0
    try:
        CORE.first_fault(**given | {"limits": (counts, *LIMITS[1:])})
    except REFUSED:
        assert counts is None or len(counts) == 4 or counts.dtype == np.float64


def test_sleeping_bodies_at_unknown_places_are_searched_last() -> None:
    boxes = zeros(6)
    boxes[[0, 3]] = np.nan
    marked = np.zeros(SLOTS, bool)
    search = CORE.Sleepers(np.arange(SLOTS), boxes, np.ones(SLOTS), 0.1, 0.1)
    assert search.mark_near(1, marked)
    assert marked[[1, 2, 4, 5, 6, 7]].all()
    boxes[:, 0] = np.arange(SLOTS)[::-1]  # another order than the one that was searched
    search.mark_near(1, marked)


@pytest.mark.parametrize("at", (0, 3, 496, 500, 501, 2**63, 2**64 - 1))
@pytest.mark.parametrize("byte", (0, 1, 255))
def test_messages_that_end_too_soon_are_refused(at: int, byte: int) -> None:
    rows = np.zeros((30, 140), np.uint8)
    assert CORE.split_bodies(np.full(500, byte, np.uint8), at, rows) is None
