"""Surfaces as others keep them, against their definitions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.io.rasters import (
    Raster,
    RasterConfig,
    from_cells,
    from_grid_map,
    from_image,
    from_points,
    occupancy_heights,
)

NAN = float("nan")
PLAIN = RasterConfig()


def height_at(raster: Raster, x: float, y: float) -> float:
    return float(HeightMap(raster.heights, geometry=raster.geometry).at([[x, y]], 0.0).heights[0])


# One map of 5 x 4 cells of 1 m about (10, 20): what it holds, north (+x) up and west (+y) to the left, and the same as
# its circular buffer stores it for several starts. Worked out by hand from the definition.
SEEN = [
    [11.0, 12.0, 13.0, 14.0],
    [21.0, 22.0, 23.0, 24.0],
    [31.0, 32.0, 33.0, 34.0],
    [41.0, 42.0, 43.0, 44.0],
    [51.0, 52.0, 53.0, 54.0],
]


@settings(deadline=None)
@given(
    along_x=st.integers(3, 9),
    along_y=st.integers(3, 9),
    data=st.data(),
    resolution=st.floats(0.01, 2.0),
    centre=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
)
def test_every_cell_of_a_grid_map_is_where_its_definition_says(
    along_x: int, along_y: int, data: st.DataObject, resolution: float, centre: tuple[float, float]
) -> None:
    """Cell (i, j) of space lies at the centre plus half a length, less (i + 1/2, j + 1/2) cells; it is stored at
    (i + outer, j + inner), modulo the size."""
    start = data.draw(st.integers(0, along_x - 1)), data.draw(st.integers(0, along_y - 1))
    stored = np.arange(along_x * along_y, dtype=np.float32).reshape(along_x, along_y)
    raster = from_grid_map(stored, start=start, centre=centre, resolution=resolution, config=PLAIN)
    for i in range(along_x):
        for j in range(along_y):
            x = centre[0] + (0.5 * along_x - i - 0.5) * resolution
            y = centre[1] + (0.5 * along_y - j - 0.5) * resolution
            wanted = stored[(i + start[0]) % along_x, (j + start[1]) % along_y]
            assert height_at(raster, x, y) == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("start", [(5, 0), (0, 4), (65535, 0)])
def test_a_buffer_that_starts_outside_is_refused(start: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="circular buffer"):
        from_grid_map(np.array(SEEN), start=start, centre=(0.0, 0.0), resolution=1.0, config=PLAIN)


def test_what_is_not_finite_is_a_hole_everywhere() -> None:
    cells = np.array(SEEN, np.float32)
    cells[1, 2], cells[3, 0] = math.inf, NAN
    raster = from_grid_map(cells, start=(0, 0), centre=(0.0, 0.0), resolution=1.0, config=PLAIN)
    assert np.isnan(raster.heights).sum() == 2
    assert np.isnan(from_image(cells, PLAIN).heights).sum() == 2


@pytest.mark.parametrize("first_row", ["top", "bottom"])
def test_an_image_is_placed_and_scaled(first_row: str) -> None:
    pixels = np.array([[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 0]], np.uint16)
    config = RasterConfig(
        scale=0.01, offset=1.0, resolution=0.5, origin=(1.0, 2.0, 3.0), first_row=first_row, zero_is_hole=True
    )  # type: ignore[arg-type]
    raster = from_image(pixels, config)
    top, bottom = (3.0, 2.0) if first_row == "top" else (2.0, 3.0)
    assert height_at(raster, 1.0, top) == pytest.approx(3.0 + 1.01)
    assert height_at(raster, 2.5, top) == pytest.approx(3.0 + 1.04)
    assert height_at(raster, 1.0, bottom) == pytest.approx(3.0 + 1.09)
    assert math.isnan(height_at(raster, 2.5, bottom))


def test_occupancy_stands_as_high_as_it_is_certain_and_unknown_is_a_hole() -> None:
    heights = occupancy_heights(np.array([[0, 50, 100, -1]], np.int8), RasterConfig(scale=2.0, offset=-0.5))
    assert np.array_equal(heights, np.array([[-0.5, 0.5, 1.5, NAN]], np.float32), equal_nan=True)
    with pytest.raises(InputError, match="101"):
        occupancy_heights(np.array([[101]], np.int8), PLAIN)


@settings(deadline=None)
@given(yaw=st.floats(-3.0, 3.0), resolution=st.floats(0.01, 5.0))
def test_samples_of_cells_lie_in_their_middles(yaw: float, resolution: float) -> None:
    raster = from_cells(np.zeros((4, 6), np.float32), corner=(1.0, 2.0, 3.0), yaw=yaw, resolution=resolution)
    turn = complex(math.cos(yaw), math.sin(yaw))
    first = complex(1.0, 2.0) + complex(0.5, 0.5) * resolution * turn
    assert raster.geometry.origin == pytest.approx((first.real, first.imag, 3.0))
    assert raster.geometry.yaw == yaw


@settings(deadline=None)
@given(
    yaw=st.floats(-3.1, 3.1),
    resolution=st.floats(0.02, 3.0),
    mirrored=st.booleans(),
    holes=st.sets(st.tuples(st.integers(0, 4), st.integers(0, 5)), max_size=12),
    corner=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)),
)
def test_points_of_an_organised_cloud_keep_their_places(
    yaw: float, resolution: float, mirrored: bool, holes: set[tuple[int, int]], corner: tuple[float, float]
) -> None:
    """Whichever way its rows run, and whatever is missing."""
    rows, columns = np.mgrid[:5, :6]
    turn = complex(math.cos(yaw), math.sin(yaw))
    places = complex(*corner) + (columns + 1j * rows * (-1 if mirrored else 1)) * resolution * turn
    points = np.stack([places.real, places.imag, 10.0 * rows + columns], axis=-1)
    for hole in holes:
        points[hole] = NAN
    raster = from_points(points, PLAIN)
    assert raster.geometry.resolution == pytest.approx(resolution, rel=1e-6)
    for x, y, z in points.reshape(-1, 3):
        if not math.isnan(z):
            row, column = np.rint(raster.geometry.to_grid(np.array([x, y]))).astype(int)
            assert raster.heights[row, column] == z
            assert raster.geometry.to_world(row, column) == pytest.approx((x, y), abs=1e-3 * resolution)
    assert np.isnan(raster.heights).sum() == len(holes)


@pytest.mark.parametrize(
    "bend",
    [
        lambda points: points * (1.0, 1.3, 1.0),  # cells that are not square
        lambda points: points + points[..., 1:2] * (0.3, 0.0, 0.0),  # sheared
        lambda points: points**2,  # unequal steps
        lambda points: np.full_like(points, NAN),
        lambda points: np.where(np.arange(4)[:, None, None] == 1, points, NAN),  # one row only
        lambda points: points * 0.0,
    ],
)
def test_clouds_that_are_no_grid_are_refused(bend: object) -> None:
    rows, columns = np.mgrid[:4, :5]
    points = np.stack([columns, rows, 0 * rows], axis=-1).astype(float)
    with pytest.raises(InputError) as error:
        from_points(bend(points), PLAIN)  # type: ignore[operator]
    assert error.value.reason in ("not_a_grid", "geometry")


def test_what_missing_points_of_a_cloud_say_does_not_matter() -> None:
    rows, columns = np.mgrid[:4, :5]
    points = np.stack([columns, rows, 0 * rows], axis=-1).astype(float)
    points[1, 1] = (math.inf, -math.inf, math.inf)
    points[2, 2] = (99.0, -99.0, NAN)
    raster = from_points(points, PLAIN)
    assert np.isnan(raster.heights).sum() == 2
    assert raster.geometry.origin == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
