"""The core at the limits of what it takes: what leads out of an array is refused, all else does no harm."""

import gc
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.motion import CLOCK, INTERVALS_KEPT, KEPT
from tests.core.entries import COLUMNS, REFUSED, ROWS, grid_of, new_grid
from tests.core.functions import BODIES, COUNT, ENTRIES, bodies, contacts, corrected, mesh_arrays, new_mesh

NAN, INF = np.nan, np.inf
OUT_OF_CLOCK = (-1, KEPT, 2**62, -(2**63))  # no numbers of velocities that are kept


def call(name: str, **changes: Any) -> dict[str, Any]:
    """Call a function with these arguments, and return all that it was given."""
    given = ENTRIES[name].made() | changes
    ENTRIES[name].function(**given)
    return given


def updated(entry: str, field: str, value: int) -> None:
    """Update a map or a mesh whose clock says so."""
    if entry == "move_vertices":
        call(entry, mesh=new_mesh(**{field: value}))
    else:
        call(entry, grid=corrected(**{field: value}))


def of_grid(method: str, *values: Any) -> object:
    return getattr(new_grid(), method)(*values)


PLACES = ((-1, 0), (0, -1), (68, 0), (0, 127), (2**62, 0), (0, 2**63 - 1), (-(2**63), 0), (2**64, 0))
UPDATES, LATTICES = ("take_rectangle", "take_corrected", "move_vertices"), ("compare", "moved_as_one")
CLOCKS = [*(("newest", n) for n in OUT_OF_CLOCK[:3]), *(("count", n) for n in (-1, INTERVALS_KEPT + 1, 2**62))]
NO_TILES = (None, [None], [1], [np.zeros(3)], np.zeros(3), "tiles", [[]], [(0, None, 0.0)], [(0, 1)])
# Functions, and arguments that they refuse.
WRONG: dict[Callable[..., Any], list[tuple[Any, ...]]] = {
    CORE.Grid: [(1, 5), (5, 1), (0, 0)],
    of_grid: [
        *(("place", *place, 0.1) for place in ((NAN, 0, 0, 0), (0, INF, 0, 0), (0, 0, NAN, 0), (0, 0, 0, INF))),
        *(("place", 0, 0, 0, 0, resolution) for resolution in (NAN, INF, -INF, 0.0, -1.0)),
        *(("set_motion", mode, 1.0, 1.0, 0.0, 0.0) for mode in (-1, 4, 2**31 - 1)),
        *(("set_layer", layer, None, value) for layer, value in ((0, -1.0), (-1, 1.0), (5, 1.0))),
    ],
    updated: [(entry, *wrong) for entry in UPDATES for wrong in CLOCKS],
    lambda name, key, value: call(name, **{key: value}): [
        ("Mesh", "triangles", np.zeros((0, 3), np.int64)), ("BodyShape.hull", "points", np.zeros((0, 3))),
        *((entry, "first", place) for entry in ("take_rectangle", "take_corrected", "fuse") for place in PLACES),
        *((entry, "time", NAN) for entry in UPDATES),
        *(("take_corrected", "grid", corrected(settle)) for settle in (0.0, NAN)),
        ("cast", "origins", np.full((COUNT, 3), 1e10)),
        *(("cast", "directions", np.tile(way, (COUNT, 1))) for way in ((0.0, 0.0, 0.0), (0.0, 0.0, 2.0))),
        *((entry, "first", place) for entry in LATTICES for place in ((2**63 - 1, 0), (0, -(2**63)), (2**53, 0))),
        *(("search_patches", "shapes", wrong) for wrong in ([], bodies()["shapes"][1:], [None] * BODIES, [1] * BODIES)),
        ("shape_above_grid", "shape", bodies()["shapes"][2]),  # a hull has no underside
        *(("Soil", "spacing", spacing) for spacing in (0.0, -1.0, NAN, 1e-3)),
        *((entry, "tiles", wrong) for entry in ENTRIES if "tiles" in ENTRIES[entry].made() for wrong in NO_TILES),
    ],
    lambda tiles: CORE.Tiles().set_tiles(tiles): [(tiles,) for tiles in NO_TILES],
    CORE.Ground: [(-1,), (10**6,)],
    CORE.SampleLattice: [(-1, 1, 1), (1, 2**62, 1), (1, 1, 0), (1, 1, 2**62)],
}  # fmt: skip


@pytest.mark.parametrize(
    ("function", "given"), [(function, given) for function, cases in WRONG.items() for given in cases]
)
def test_what_leads_out_of_an_array_is_refused(function: Callable[..., Any], given: tuple[Any, ...]) -> None:
    with pytest.raises((*REFUSED, RuntimeError)):
        function(*given)


@pytest.fixture
def ground() -> Iterator[Any]:
    """A ground in a client of its own: the sanitized core runs these tests without `conftest` and its fixtures."""
    client = BulletClient(pb.DIRECT)
    yield CORE.Ground(client.executePluginCommand(client.loadPlugin(CORE.__file__, "_smartmesh"), "", []))
    client.disconnect()


@pytest.mark.parametrize("slot", [-1, 0, 1, 2**31 - 1, -(2**31)])
def test_slots_that_nobody_has_tiles_that_are_none_and_rules_that_are_no_numbers_are_refused(
    ground: Any, slot: int
) -> None:
    for wrong in (
        lambda: ground.detach(slot),
        lambda: ground.attach(slot, 0, -1, 0, BodyShape.ball(0.1)),  # PyBullet has no body
        lambda: ground.drive(slot, (0.0, 1.0, 0.0), 1.0),
        lambda: ground.wake(slot),
        lambda: ground.is_asleep(slot),
        lambda: ground.set_kind(slot, True, True, False),
        *(lambda tiles=tiles: ground.set_tiles(tiles) for tiles in (None, [], CORE.Deck())),
        *(lambda least=least: ground.set_sleep(least, 0.1, 0.1, 0.1, 0.1, 0.1) for least in (-1.0, math.nan)),
        lambda: ground.set_sleep(0.5, math.nan, 0.1, 0.1, 0.1, 0.1),
    ):
        with pytest.raises((*REFUSED, RuntimeError)):
            wrong()


def test_slots_that_nobody_has_do_no_harm(ground: Any) -> None:
    assert ground.find_asleep() == ground.find_below() == ground.find_nowhere(1.0) == []
    assert np.isnan(ground.read(np.array([0, 1, -1, 2**31 - 1, -(2**31), 2**62, -(2**63)]))).all()
    assert len(ground.bodies()) == 0


def test_arrays_are_views_of_the_core_which_they_keep() -> None:
    grid = new_grid()
    heights, clocks = grid.heights, grid.clocks
    heights[:] = 2.0
    assert grid.sample(ROWS - 1, COLUMNS - 1, 0.0, 0.1) == (2.0, 0.0)
    grid.begin_fusion()
    known, variances = grid.fused
    del grid
    gc.collect()
    known[...] = variances
    assert np.unique(heights) == 2.0 and np.unique(known) == 0.0 and not clocks.any()


def test_each_byte_of_a_clock_belongs_to_one_field() -> None:
    """So that a field that is added, or changes places, is the same one on both sides."""
    bytes_of = [range(place, place + kind.itemsize) for kind, place in CLOCK.fields.values()]
    assert sorted(byte for field in bytes_of for byte in field) == list(range(CLOCK.itemsize))


@pytest.mark.parametrize("newest", OUT_OF_CLOCK)
def test_a_clock_that_names_no_velocity_reads_none(newest: int) -> None:
    fields = {"known": KEPT, "newest": newest, "lifetime": 1.0, "middle": -0.05, "middle_1": -0.15, "middle_2": -0.25}
    for noise in (0.0, 0.1):
        grid = new_grid(**fields)
        grid.set_motion(1, 25.0, 0.2, noise, 0.0)
        assert grid.sample(3, 3, 0.5, 0.1) == (0.0, 0.0)
        assert not call("grid_window", grid=grid, time=0.5)["heights"].any()
    positions, velocities = CORE.sample_mesh(new_mesh(**fields), np.arange(4), 0.1, 0.1)
    np.testing.assert_array_equal(positions, mesh_arrays()["vertices"].T)
    assert not velocities.any()


FAR = 2**31 - 1


@pytest.mark.parametrize("place", [(-1, 0), (0, -1), (ROWS, 0), (0, COLUMNS), (FAR, 0), (-FAR, -FAR), (-3, 2)])
def test_places_beyond_a_grid_are_no_ground(place: tuple[int, int]) -> None:
    assert np.isnan(new_grid().sample(*place, 0.0, 0.1)[0])
    row, column = (max(min(value, 2**29), -(2**29)) for value in place)
    window = call("grid_window", row=row, column=column)["heights"]
    rows, columns = (start + np.arange(COUNT) for start in (row, column))
    inside = np.outer((rows >= 0) & (rows < ROWS), (columns >= 0) & (columns < COLUMNS))
    np.testing.assert_array_equal(np.isfinite(window), inside)


def test_numbers_of_samples_beyond_a_grid_are_no_ground() -> None:
    found, _ = CORE.sample_grid(new_grid(), np.array([-1, ROWS * COLUMNS, 2**62, -(2**63), 0, 1]), 0.0, 0.1)
    np.testing.assert_array_equal(np.isnan(found), [True] * 4 + [False] * 2)


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_there_are_no_contacts_with_heights_and_no_scans_from_places_that_are_not_finite(value: float) -> None:
    """A body may be at no place until it is removed; the grid around it may not."""
    tiles = [grid_of(np.full((8, 8), value, np.float32))]
    assert not len(CORE.find_contacts(**(contacts() | {"tiles": tiles})))
    for column in range(3):
        poses = np.ones((COUNT, 3))
        poses[-1, column] = value if value > -INF else -1e10
        found = call("scan_heights", poses=poses)["heights"]
        assert np.isnan(found).any(axis=1).tolist() == [False] * (COUNT - 1) + [True]


@pytest.mark.parametrize(
    "changes",
    [{"tiles": [grid_of(np.zeros((8, 8), np.float32), 1e-300)]}, {"margin": 1e8}, {"duration": 1e8}],
    ids=["cells", "margin", "duration"],
)
def test_contacts_of_extreme_numbers_do_no_harm(changes: dict[str, Any]) -> None:
    with suppress(*REFUSED):
        call("find_contacts", motion=np.full((2, 3), 1e6), **changes)


@pytest.mark.parametrize(
    "points", [np.zeros((1, 3)), np.zeros((9, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0]), np.eye(3)]
)
def test_contacts_of_hulls_without_volume_are_finite(points: np.ndarray) -> None:
    found = CORE.find_contacts(**(contacts() | {"shape": BodyShape.hull(points, 0.01)}))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("name", ["ground_heights", "ground_samples", "cast"])
def test_questions_without_tiles_or_points_and_to_grids_of_any_size_anywhere_do_no_harm(name: str) -> None:
    given = call(name, tiles=CORE.Tiles())
    call(name, **{key: value[:0] for key, value in given.items() if isinstance(value, np.ndarray)})
    for resolution in (1e-300, 1e-9, 1e9, 1e300):
        for place in (0.0, 1e300, -1e300):
            grid, other = new_grid(), new_grid()
            grid.place(place, 0.0, 0.0, 1.0, resolution)
            other.place(1.0, 1.0, 0.0, 0.0, 0.1)
            call(name, tiles=CORE.Tiles([grid, other]))


def test_a_lattice_may_be_smaller_than_the_map_and_does_not_know_points_that_are_too_far_away() -> None:
    lattice = CORE.SampleLattice(5, 5, 5)
    for _ in range(2):
        counts, _ = lattice.compare(**ENTRIES["compare"].made())
    assert counts[0] <= ROWS * COLUMNS
    for first in (2**52, -(2**52)):
        assert not lattice.moved_as_one(**ENTRIES["moved_as_one"].made() | {"first": (first, first)})


@pytest.mark.parametrize("at", [0, 3, 496, 500, 501, 2**63, 2**64 - 1])
@pytest.mark.parametrize("byte", [0, 1, 255])
def test_messages_that_end_too_soon_are_refused(at: int, byte: int) -> None:
    rows = np.zeros((30, 140), np.uint8)
    assert CORE.split_bodies(np.full(500, byte, np.uint8), at, rows) is None
