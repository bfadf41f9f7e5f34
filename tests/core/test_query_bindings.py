"""Queries of the ground refuse what would make the core read or write outside an array, as tests/core/test_bindings.py
says of the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.motion import CLOCK, KEPT
from tests.core.test_bindings import REFUSED, SPOILT, arrays

COUNT = 6


def mesh() -> Any:
    clock = np.zeros(1, CLOCK)
    clock["known"], clock["newest"], clock["lifetime"] = KEPT, 1, 1.0
    return _core.Mesh(
        np.arange(12.0).reshape(3, 4) ** 2, np.ones((KEPT, 3, 4)), clock.view(np.uint8).reshape(1, CLOCK.itemsize),
        np.array([[0, 1, 2], [1, 2, 3]]),
    )  # fmt: skip


def calls() -> dict[str, tuple[Any, dict[str, Any]]]:
    """Return each function with arguments that it takes."""
    grid, down = _core.Grid(**arrays()), np.tile([0.0, 0.0, -1.0], (COUNT, 1))
    rows = {"heights": np.zeros(COUNT), "velocities": np.zeros(COUNT)}
    return {
        "ground_heights": (
            _core.ground_heights, {"tiles": [grid, mesh()], "points": np.ones((COUNT, 2)), "time": 0.0} | rows
        ),
        "ground_samples": (
            _core.ground_samples,
            {
                "tiles": [grid, mesh()], "points": np.ones((COUNT, 3)), "time": 0.0, "heights": np.zeros(COUNT),
                "normals": np.zeros((COUNT, 3)), "velocities": np.zeros((COUNT, 3)), "ages": np.zeros(COUNT),
            },
        ),
        "cast": (
            _core.RayCaster().cast,
            {
                "tiles": [grid, mesh()], "origins": np.ones((COUNT, 3)), "directions": down, "reach": 5.0, "time": 0.0,
                "distances": np.zeros(COUNT), "normals": np.zeros((COUNT, 3)),
            },
        ),
        "scan_heights": (
            _core.scan_heights,
            {
                "tiles": [grid, mesh()], "poses": np.ones((COUNT, 3)), "pattern": np.ones((4, 2)), "time": 0.0,
                "heights": np.zeros((COUNT, 4)),
            },
        ),
        "sample_grid": (
            _core.sample_grid, {"grid": grid, "indices": np.arange(COUNT), "time": 0.0, "ahead": 0.1} | rows
        ),
        "grid_window": (
            _core.grid_window, {"grid": grid, "row": 0, "column": 0, "time": 0.0, "heights": np.zeros((COUNT, COUNT))}
        ),
        "sample_mesh": (
            _core.sample_mesh,
            {
                "mesh": mesh(), "indices": np.arange(4), "time": 0.0, "ahead": 0.1, "positions": np.zeros((4, 3)),
                "velocities": np.zeros((4, 3)),
            },
        ),
    }  # fmt: skip


ARRAYS = [
    (name, key) for name, (_, given) in calls().items() for key, value in given.items() if isinstance(value, np.ndarray)
]
WRITTEN = {"heights", "velocities", "normals", "ages", "distances", "positions"}


@pytest.mark.parametrize("name", calls())
def test_good_arguments_are_taken(name: str) -> None:
    function, given = calls()[name]
    function(**given)


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name, key", ARRAYS)
def test_arrays_that_do_not_fit_are_refused(name: str, key: str, how: str) -> None:
    function, given = calls()[name]
    good, spoilt = given[key], SPOILT[how](given[key])
    given[key] = spoilt
    smaller = name == "grid_window" and how in ("one row fewer", "one column fewer", "empty", "empty rows")
    as_good = isinstance(spoilt, np.ndarray) and (spoilt.shape, spoilt.dtype) == (good.shape, good.dtype)
    if smaller or (as_good and spoilt.flags.c_contiguous and spoilt.flags.aligned):
        function(**given)  # a smaller window is a window; a row has one order in memory
        return
    with pytest.raises(REFUSED):
        function(**given)


@pytest.mark.parametrize("name, key", [pair for pair in ARRAYS if pair[1] in WRITTEN])
def test_read_only_results_are_refused(name: str, key: str) -> None:
    function, given = calls()[name]
    given[key].setflags(write=False)
    with pytest.raises(REFUSED):
        function(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf))
@pytest.mark.parametrize("key", ("time", "ahead", "reach"))
@pytest.mark.parametrize("name", calls())
def test_numbers_that_are_not_finite_are_refused(name: str, key: str, value: float) -> None:
    function, given = calls()[name]
    if key in given:
        with pytest.raises(REFUSED):
            function(**(given | {key: value}))


@pytest.mark.parametrize("tiles", ([None], [np.zeros(3)], None, "tiles", [[]]))
@pytest.mark.parametrize("name", ("ground_heights", "ground_samples", "cast", "scan_heights"))
def test_only_grids_and_meshes_are_tiles(name: str, tiles: Any) -> None:
    function, given = calls()[name]
    with pytest.raises((*REFUSED, RuntimeError)):
        function(**(given | {"tiles": tiles}))


def test_without_tiles_or_points_there_is_nothing() -> None:
    for name in ("ground_heights", "ground_samples", "cast"):
        function, given = calls()[name]
        function(**(given | {"tiles": []}))
        found = given["distances" if name == "cast" else "heights"]
        assert (np.isinf(found) | np.isnan(found) | (found == 0.0)).all()
        empty = {key: value[:0] if isinstance(value, np.ndarray) else value for key, value in given.items()}
        function(**empty)


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e300, -1e300))
@pytest.mark.parametrize("axis", (0, 1, 2))
def test_points_anywhere_do_no_harm(axis: int, value: float) -> None:
    for name in ("ground_heights", "ground_samples"):
        function, given = calls()[name]
        if axis < given["points"].shape[1]:
            given["points"][:, axis] = value
            function(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, -1e10))
def test_scans_from_nowhere_find_no_ground(value: float) -> None:
    """A body may be at no place until it is removed; the grid around it may not."""
    for column in range(3):
        function, given = calls()["scan_heights"]
        given["poses"][-1, column] = value
        function(**given)
        assert np.isnan(given["heights"]).any(axis=1).tolist() == [False] * (COUNT - 1) + [True]
    for column in range(2):
        function, given = calls()["scan_heights"]
        given["pattern"][-1, column] = value
        with pytest.raises(REFUSED):
            function(**given)


@pytest.mark.parametrize("value", (np.nan, np.inf, 1e10))
def test_rays_from_nowhere_are_refused(value: float) -> None:
    function, given = calls()["cast"]
    given["origins"][3, 1] = value
    with pytest.raises(REFUSED):
        function(**given)


@pytest.mark.parametrize("way", ((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0)))
def test_directions_have_length_one(way: tuple[float, float, float]) -> None:
    function, given = calls()["cast"]
    given["directions"][2] = way
    with pytest.raises(REFUSED):
        function(**given)


@pytest.mark.parametrize("resolution", (1e-300, 1e-9, 1e9, 1e300))
@pytest.mark.parametrize("place", (0.0, 1e300, -1e300))
def test_grids_of_any_size_anywhere_do_no_harm(resolution: float, place: float) -> None:
    grid, other = _core.Grid(**arrays()), _core.Grid(**arrays())
    grid.place(place, 0.0, 0.0, 1.0, resolution)
    other.place(1.0, 1.0, 0.0, 0.0, 0.1)
    for name in ("ground_heights", "ground_samples", "cast"):
        function, given = calls()[name]
        function(**(given | {"tiles": [grid, other]}))


def test_samples_beyond_a_grid_are_no_ground_and_vertices_beyond_a_mesh_are_refused() -> None:
    far = np.array([-1, 70 * 130, 2**62, -(2**63), 0, 1])
    function, given = calls()["sample_grid"]
    function(**(given | {"indices": far}))
    np.testing.assert_array_equal(np.isnan(given["heights"]), [True] * 4 + [False] * 2)
    for index in far[:4]:
        function, given = calls()["sample_mesh"]
        given["indices"][2] = index
        with pytest.raises(REFUSED):
            function(**given)


@pytest.mark.parametrize("place", ((2**29, 0), (-(2**29), -(2**29)), (0, 2**29), (-3, -3), (68, 128)))
def test_windows_may_be_beyond_a_grid(place: tuple[int, int]) -> None:
    function, given = calls()["grid_window"]
    function(**(given | {"row": place[0], "column": place[1]}))
    rows, columns = (start + np.arange(COUNT) for start in place)
    inside = np.outer((rows >= 0) & (rows < 70), (columns >= 0) & (columns < 130))
    np.testing.assert_array_equal(np.isfinite(given["heights"]), inside)


@pytest.mark.parametrize("newest", (-1, KEPT, 2**62, -(2**63)))
def test_a_clock_that_names_no_velocity_reads_none(newest: int) -> None:
    clocks = np.zeros((2, 3), CLOCK)
    clocks["known"], clocks["newest"], clocks["lifetime"], clocks["middle"] = KEPT, newest, 1.0, -0.05
    for noise in (0.0, 0.1):
        grid = _core.Grid(**(arrays() | {"clocks": clocks.view(np.uint8).reshape(2, 3, CLOCK.itemsize)}))
        grid.set_motion(1, 25.0, 0.2, noise, 0.0)
        window = np.empty((70, 130))
        _core.grid_window(grid, 0, 0, 0.5, window)
        assert not window.any()
    vertices, positions = np.arange(12.0).reshape(3, 4) ** 2, np.empty((4, 3))
    ring = clocks[0, :1].view(np.uint8).reshape(1, CLOCK.itemsize)
    made = _core.Mesh(vertices, np.ones((KEPT, 3, 4)), ring, np.array([[0, 1, 2]]))
    made.set_motion(1, 25.0)
    _core.sample_mesh(made, np.arange(4), 0.5, 0.1, positions, np.empty((4, 3)))
    np.testing.assert_array_equal(positions, vertices.T)
