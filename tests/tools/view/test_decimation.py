"""A decimated map covers all of it without cracks, and is whole near the bodies."""

from collections import Counter

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.tools.view.decimation import MOST_CELLS, decimate
from tests.examples import examples

SHAPES = st.tuples(st.integers(2, 150), st.integers(2, 150))
BODIES = st.lists(st.tuples(st.floats(-50, 200), st.floats(-50, 200), st.floats(0, 12)), max_size=4)


@given(shape=SHAPES, bodies=BODIES)
@example((42, 50), [(0.0, 0.0, 1.3016348669493289e-15)])
@examples(100)
def test_the_triangles_cover_the_map_once_without_cracks_and_all_of_it_near_bodies(
    shape: tuple[int, int], bodies: list[tuple[float, float, float]]
) -> None:
    table = np.array(bodies).reshape(-1, 3)
    surface = decimate(shape, table[:, :2], table[:, 2], far_cells=40, most_cells=4000)
    corners = surface.triangles
    (x0, x1, x2), (y0, y1, y2) = surface.columns[corners].T, surface.rows[corners].T
    areas = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)  # twice those of the triangles, positive = counter-clockwise
    assert areas.min() > 0
    assert areas.sum() == 2 * (shape[0] - 1) * (shape[1] - 1)
    # Every edge has a triangle on either side, the other way round, but for those on the border of the map.
    edges = Counter(map(tuple, np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).tolist()))
    assert set(edges.values()) == {1}
    for start, end in edges:
        if (end, start) not in edges:
            rows, columns = surface.rows[[start, end]], surface.columns[[start, end]]
            assert any((line == value).all() for line, value in ((rows, 0), (columns, 0), (rows, shape[0] - 1),
                                                                 (columns, shape[1] - 1)))  # fmt: skip
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
