"""Maps, meshes, contacts, queries and updates of the core at the limits of what they take."""

import gc
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.motion import CLOCK, INTERVALS_KEPT, KEPT
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.core.entries import COLUMNS, REFUSED, ROWS, clock_bytes, grid_of, new_grid
from tests.core.ground_entries import COUNT, ENTRIES, contacts, lattice, mesh_arrays
from tests.core.test_arguments import NO_TILES

OUT_OF_CLOCK = (-1, KEPT, 2**62, -(2**63))  # no numbers of velocities that are kept


def call(name: str, **changes: Any) -> dict[str, Any]:
    """Call a function with these arguments, and return all that it was given."""
    given = ENTRIES[name].made() | changes
    ENTRIES[name].function(**given)
    return given


@pytest.mark.parametrize(("rows", "columns"), [(1, 5), (5, 1), (0, 0)])
def test_a_grid_has_at_least_a_cell(rows: int, columns: int) -> None:
    with pytest.raises(REFUSED):
        CORE.Grid(rows, columns)


@pytest.mark.parametrize(
    ("method", "values"),
    [
        *(("place", place) for place in ((np.nan, 0, 0, 0, 0.1), (0, np.inf, 0, 0, 0.1), (0, 0, np.nan, 0, 0.1))),
        ("place", (0, 0, 0, np.inf, 0.1)),
        *(("place", (0, 0, 0, 0, resolution)) for resolution in (np.nan, np.inf, -np.inf, 0.0, -1.0)),
        *(("set_motion", (mode, 1.0, 1.0, 0.0, 0.0)) for mode in (-1, 4, 2**31 - 1)),
        *(("set_layer", values) for values in ((0, None, -1.0), (-1, None, 1.0), (5, None, 1.0))),
    ],
)  # fmt: skip
def test_a_grid_has_a_finite_place_a_resolution_above_zero_and_a_known_motion(method: str, values: Any) -> None:
    with pytest.raises(REFUSED):
        getattr(new_grid(), method)(*values)


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


@pytest.mark.parametrize("place", [(-1, 0), (0, -1), (ROWS, 0), (0, COLUMNS), (2**31 - 1, 0), (-(2**31), -(2**31))])
def test_samples_beyond_a_grid_are_no_ground(place: tuple[int, int]) -> None:
    height, rise = new_grid().sample(*place, 0.0, 0.1)
    assert np.isnan(height) and rise == 0.0


@pytest.mark.parametrize("newest", OUT_OF_CLOCK)
def test_a_clock_that_names_no_velocity_reads_none(newest: int) -> None:
    fields = {"known": KEPT, "newest": newest, "lifetime": 1.0, "middle": -0.05, "middle_1": -0.15, "middle_2": -0.25}
    for noise in (0.0, 0.1):
        grid = new_grid(**fields)
        grid.set_motion(1, 25.0, 0.2, noise, 0.0)
        assert grid.sample(3, 3, 0.5, 0.1) == (0.0, 0.0)
        assert not call("grid_window", grid=grid, time=0.5)["heights"].any()
    mesh = CORE.Mesh(**mesh_arrays() | {"clock": clock_bytes(1, **fields)})
    mesh.set_motion(1, 25.0, 0.0)
    found = call(
        "sample_mesh", mesh=mesh, indices=np.arange(4), positions=np.empty((4, 3)), velocities=np.empty((4, 3))
    )
    np.testing.assert_array_equal(found["positions"], mesh_arrays()["vertices"].T)
    assert not found["velocities"].any()


def test_arrays_that_are_no_mesh_are_refused_with_what_is_wrong() -> None:
    good, triangles = mesh_arrays(), mesh_arrays()["triangles"]
    for name, value, what in [
        ("vertices", np.zeros((2, 9)), "shape"), ("velocities", np.zeros((3, 3, 8)), "velocities"),
        ("clock", good["clock"][:, :80].copy(), "clock"), ("triangles", triangles + 1, "counted from 0"),
        ("triangles", np.zeros((0, 3), np.int64), "triangles"),
    ]:  # fmt: skip
        with pytest.raises(ValueError, match=what):
            CORE.Mesh(**good | {name: value})
    mesh = TriangleMesh(*mesh_parts.sheet(1.0, 2))
    reader = mesh.core_reader
    mesh._now[0, 0] = np.inf
    with pytest.raises(ValueError, match="finite"):
        reader.set_motion(1, 25.0, 0.0)


@pytest.mark.parametrize(
    "changes",
    [{"tiles": [grid_of(np.zeros((8, 8), np.float32), 1e-300)]}, {"margin": 1e8}, {"duration": 1e8}],
    ids=["cells", "margin", "duration"],
)
def test_contacts_of_extreme_numbers_do_no_harm(changes: dict[str, Any]) -> None:
    try:
        call("find_contacts", motion=np.full((2, 3), 1e6), **changes)
    except REFUSED:
        return


def test_there_are_no_contacts_with_heights_that_are_not_finite() -> None:
    for value in (np.nan, np.inf, -np.inf):
        tiles = [grid_of(np.full((8, 8), value, np.float32))]
        assert not len(CORE.find_contacts(**(contacts() | {"tiles": tiles})))


def test_hulls_without_volume_do_no_harm_and_without_points_are_refused() -> None:
    for points in (np.zeros((1, 3)), np.zeros((9, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0]), np.eye(3)):
        found = CORE.find_contacts(**(contacts() | {"shape": CORE.Shape.hull(points, 0.01)}))
        assert np.isfinite(found).all()
    with pytest.raises(REFUSED):
        CORE.Shape.hull(np.zeros((0, 3)), 0.0)


@pytest.fixture
def ground() -> Iterator[Any]:
    client: Any = BulletClient(pb.DIRECT)
    yield CORE.Ground(client.executePluginCommand(client.loadPlugin(CORE.__file__, "_smartmesh"), "", []))
    client.disconnect()


@pytest.mark.parametrize("slot", [-1, 0, 1, 2**31 - 1, -(2**31)])
def test_slots_that_nobody_has_are_refused(ground: Any, slot: int) -> None:
    states = np.zeros((1, 13)) if slot else np.zeros((0, 13))
    for wrong in (
        lambda: ground.detach(slot),
        lambda: ground.read(np.array([slot], np.int64), states),
        lambda: ground.attach(slot, 0, -1, 0, BodyShape.ball(0.1)),  # PyBullet has no body
        lambda: ground.drive(slot, (0.0, 1.0, 0.0), 1.0),
        lambda: ground.wake(slot),
        lambda: ground.is_asleep(slot),
        lambda: ground.set_kind(slot, True, True, False),
    ):
        with pytest.raises(REFUSED):
            wrong()


def test_tiles_and_plugins_that_do_not_fit_are_refused(ground: Any) -> None:
    for wrong in (None, [], CORE.Deck()):
        with pytest.raises((*REFUSED, RuntimeError)):
            ground.set_tiles(wrong)
    for tiles in NO_TILES:
        with pytest.raises((*REFUSED, RuntimeError)):
            CORE.Tiles().set_tiles(tiles)
    for number in (-1, 10**6):
        with pytest.raises(RuntimeError):
            CORE.Ground(number)


@pytest.mark.parametrize("rules", [(-1.0, *(0.1,) * 5), (math.nan, *(0.1,) * 5), (0.5, math.nan, *(0.1,) * 4)])
def test_rules_of_sleep_are_numbers(ground: Any, rules: tuple[float, ...]) -> None:
    with pytest.raises(REFUSED):
        ground.set_sleep(*rules)


def test_slots_that_nobody_has_do_no_harm(ground: Any) -> None:
    assert ground.find_asleep() == ground.find_below() == ground.find_nowhere(1.0) == []
    states = np.zeros((4, 13))
    ground.read(np.arange(4), states)
    assert np.isnan(states).all()


@pytest.mark.parametrize("name", ["ground_heights", "ground_samples", "cast"])
def test_without_tiles_or_points_there_is_nothing(name: str) -> None:
    given = call(name, tiles=[])
    found = given["distances" if name == "cast" else "heights"]
    assert (np.isinf(found) | np.isnan(found) | (found == 0.0)).all()
    call(name, **{key: value[:0] for key, value in given.items() if isinstance(value, np.ndarray)})


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e10])
def test_scans_from_nowhere_find_no_ground(value: float) -> None:
    """A body may be at no place until it is removed; the grid around it may not."""
    for column in range(3):
        poses = np.ones((COUNT, 3))
        poses[-1, column] = value
        found = call("scan_heights", poses=poses)["heights"]
        assert np.isnan(found).any(axis=1).tolist() == [False] * (COUNT - 1) + [True]


@pytest.mark.parametrize("resolution", [1e-300, 1e-9, 1e9, 1e300])
@pytest.mark.parametrize("place", [0.0, 1e300, -1e300])
@pytest.mark.parametrize("name", ["ground_heights", "ground_samples", "cast"])
def test_grids_of_any_size_anywhere_do_no_harm(name: str, resolution: float, place: float) -> None:
    grid, other = new_grid(), new_grid()
    grid.place(place, 0.0, 0.0, 1.0, resolution)
    other.place(1.0, 1.0, 0.0, 0.0, 0.1)
    call(name, tiles=[grid, other])


def test_numbers_of_samples_beyond_a_grid_are_no_ground() -> None:
    found = call("sample_grid", indices=np.array([-1, ROWS * COLUMNS, 2**62, -(2**63), 0, 1]))["heights"]
    np.testing.assert_array_equal(np.isnan(found), [True] * 4 + [False] * 2)


@pytest.mark.parametrize("place", [(2**29, 0), (-(2**29), -(2**29)), (0, 2**29), (-3, -3), (68, 128)])
def test_windows_may_be_beyond_a_grid(place: tuple[int, int]) -> None:
    found = call("grid_window", row=place[0], column=place[1])["heights"]
    rows, columns = (start + np.arange(COUNT) for start in place)
    inside = np.outer((rows >= 0) & (rows < ROWS), (columns >= 0) & (columns < COLUMNS))
    np.testing.assert_array_equal(np.isfinite(found), inside)


PLACES = ((-1, 0), (0, -1), (68, 0), (0, 127), (2**62, 0), (0, 2**63 - 1), (-(2**63), 0), (2**64, 0))
LATTICES = ("compare_maps", "moved_as_one")


@pytest.mark.parametrize(
    ("entry", "name", "value"),
    [
        *((entry, "first", place) for entry in ("take_rectangle", "take_corrected", "fuse") for place in PLACES),
        *((entry, "time", np.nan) for entry in ("take_rectangle", "take_corrected", "move_vertices")),
        ("cast", "origins", np.full((COUNT, 3), 1e10)),
        *(("cast", "directions", np.tile(way, (COUNT, 1))) for way in ((0.0, 0.0, 0.0), (0.0, 0.0, 2.0))),
        *((entry, "stride", s) for entry in LATTICES for s in ((0, 1), (1, 0), (-1, 1), (2**62, 1), (1, 2**62))),
        *((entry, "first", place) for entry in LATTICES for place in ((2**63 - 1, 0), (0, -(2**63)), (2**53, 0))),
    ],
)  # fmt: skip
def test_numbers_that_lead_out_of_a_map_are_refused(entry: str, name: str, value: Any) -> None:
    with pytest.raises(REFUSED):
        call(entry, **{name: value})


@pytest.mark.parametrize("entry", ["take_rectangle", "take_corrected", "move_vertices"])
def test_clocks_that_lead_out_of_an_array_are_refused(entry: str) -> None:
    wrong = [("newest", value) for value in (-1, KEPT, 2**62)]
    for field, value in [*wrong, *(("count", value) for value in (-1, INTERVALS_KEPT + 1, 2**62))]:
        if entry == "move_vertices":
            ground = {"mesh": CORE.Mesh(**mesh_arrays() | {"clock": clock_bytes(1, **{field: value})})}
        else:
            grid = new_grid(**{field: value})
            grid.set_motion(3, 25.0, 0.2, 0.0, 0.0)
            ground = {"grid": grid}
        with pytest.raises(REFUSED):
            call(entry, **ground)


def test_corrections_need_a_time_to_settle() -> None:
    for settle in (0.0, np.nan):
        grid = new_grid()
        grid.set_motion(3, 25.0, settle, 0.0, 0.0)
        with pytest.raises(REFUSED):
            call("take_corrected", grid=grid)


def test_a_lattice_may_be_smaller_than_the_map_and_does_not_know_points_that_are_too_far_away() -> None:
    counts, _ = CORE.compare_maps(**(lattice() | {"stride": (1, 1)}))
    assert counts[0] <= ROWS * COLUMNS
    for cell in (2**40, 2**63 - 1, -(2**63)):
        assert not CORE.moved_as_one(**(lattice() | {"cells": np.full((8, 14, 2), cell)}))


def test_each_byte_of_a_clock_belongs_to_one_field() -> None:
    """So that a field that is added, or changes places, is the same one on both sides."""
    bytes_of = [range(place, place + kind.itemsize) for kind, place in CLOCK.fields.values()]
    assert sorted(byte for field in bytes_of for byte in field) == list(range(CLOCK.itemsize))
