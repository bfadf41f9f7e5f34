"""A decimated map covers all of it without cracks, and is whole near the bodies."""

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.tools.view.decimation import MOST_CELLS, Surface, decimate
from tests.examples import examples

SHAPES = st.tuples(st.integers(2, 150), st.integers(2, 150))
BODIES = st.lists(st.tuples(st.floats(-50, 200), st.floats(-50, 200), st.floats(0, 12)), max_size=4)


def surface_of(shape: tuple[int, int], bodies: list[tuple[float, float, float]]) -> Surface:
    table = np.array(bodies).reshape(-1, 3)
    return decimate(shape, table[:, :2], table[:, 2], far_cells=40, most_cells=4000)


def areas(surface: Surface) -> np.ndarray:
    """Twice the area of each triangle seen from above [cells], positive = counter-clockwise."""
    (x0, x1, x2), (y0, y1, y2) = surface.columns[surface.triangles].T, surface.rows[surface.triangles].T
    return (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)


@given(shape=SHAPES, bodies=BODIES)
@examples(100)
def test_the_triangles_cover_the_map_once(shape: tuple[int, int], bodies: list[tuple[float, float, float]]) -> None:
    surface = surface_of(shape, bodies)
    assert areas(surface).min() > 0
    assert areas(surface).sum() == 2 * (shape[0] - 1) * (shape[1] - 1)


@given(shape=SHAPES, bodies=BODIES)
@examples(100)
def test_there_are_no_cracks(shape: tuple[int, int], bodies: list[tuple[float, float, float]]) -> None:
    """Every edge has a triangle on either side, the other way round, but for those on the border of the map."""
    surface = surface_of(shape, bodies)
    corners = surface.triangles
    edges = Counter(map(tuple, np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).tolist()))
    assert set(edges.values()) == {1}
    for start, end in edges:
        if (end, start) not in edges:
            rows, columns = surface.rows[[start, end]], surface.columns[[start, end]]
            assert any((line == value).all() for line, value in ((rows, 0), (columns, 0), (rows, shape[0] - 1),
                                                                 (columns, shape[1] - 1)))  # fmt: skip


@given(shape=SHAPES, bodies=BODIES)
@examples(100)
def test_the_map_is_whole_near_bodies(shape: tuple[int, int], bodies: list[tuple[float, float, float]]) -> None:
    surface = surface_of(shape, bodies)
    shown = np.zeros(shape, bool)
    shown[surface.rows, surface.columns] = True
    r, c = np.mgrid[: shape[0], : shape[1]]
    for row, column, near in bodies:
        assert shown[np.maximum(abs(r - row), abs(c - column)) < near].all()


def test_a_large_map_is_one_that_a_browser_draws() -> None:
    """Far from bodies few samples are left, and many bodies do not make it larger."""
    surface = decimate((4096, 4096), np.array([[2000.0, 2000.0]]), np.array([20.0]))
    assert len(surface.rows) < 30_000
    assert (surface.rows.max(), surface.columns.max()) == (4095, 4095)
    places = np.random.default_rng(0).uniform(0, 4096, (400, 2))
    assert len(decimate((4096, 4096), places, np.full(400, 100.0)).triangles) < 4 * MOST_CELLS
