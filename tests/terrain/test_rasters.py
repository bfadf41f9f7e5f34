"""Surfaces as others keep them, against their definitions.

Masked arrays: cells without data are holes, whatever number lies below the mask.
"""

import math
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, InputError, MotionConfig
from smartmesh_ros.io.rasters import RasterConfig, from_grid_map, from_image, from_points
from smartmesh_ros.terrain.motion import Changes

NAN = float("nan")
PLAIN = RasterConfig()
CELLS = np.arange(20.0, dtype=np.float32).reshape(5, 4)


@pytest.mark.parametrize("missing", [NAN, math.inf, -math.inf, np.ma.masked])
def test_what_is_missing_is_a_hole_in_every_raster_whatever_lies_there(missing: Any) -> None:
    cells = np.ma.array(CELLS, copy=True)
    cells[1, 2] = missing
    image = from_image(cells, PLAIN)
    np.testing.assert_array_equal(np.isnan(image.heights[::-1]), np.isin(CELLS, 6.0))
    layer = from_grid_map(cells, start=(3, 0), centre=(0.0, 0.0), resolution=1.0, config=PLAIN, variances=cells)
    assert np.isnan(layer.heights).sum() == (~np.isfinite(layer.variances)).sum() == 1
    y, x = np.ma.array(np.mgrid[:5, :4].astype(np.float64))
    x[0, 1], y[0, 1], cells[0, 1] = 99.0, -99.0, missing
    x[1, 2] = y[1, 2] = missing
    cloud = from_points(np.ma.stack([x, y, cells], axis=-1), PLAIN)
    np.testing.assert_array_equal(np.isnan(cloud.heights), np.isin(CELLS, (6.0, 1.0)))
    assert cloud.geometry.origin == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


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


NO_DATA = -9999.0
WHERE = [[0.0, -1.0], [0.0, 1.0]]


def masked(kind: Any = np.float64) -> Any:
    """A level map; its half along +y has no data."""
    heights = np.zeros((41, 41), kind)
    heights[20:] = NO_DATA
    return np.ma.masked_equal(heights, NO_DATA)


def heightmap(heights: Any, **options: Any) -> HeightMap:
    return HeightMap(heights, resolution=0.1, origin=(-2.0, -2.0), **options)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int16])
@pytest.mark.parametrize("changes", get_args(Changes))
def test_masked_heights_are_holes(kind: Any, changes: Changes) -> None:
    motion = MotionConfig(changes=changes)
    made = heightmap(masked(kind), motion=motion)
    replaced, updated = heightmap(np.full((41, 41), np.nan), motion=motion), heightmap(masked(kind), motion=motion)
    replaced.replace(masked(kind), time=1.0)
    updated.update_region(0, 0, masked(kind)[:30], time=1.0)
    for ground in (made, replaced, updated):
        np.testing.assert_array_equal(ground.at(WHERE, 1.0).heights, [0.0, np.nan])


def test_masked_velocities_are_none_and_masked_variances_are_unknown() -> None:
    speeds = np.ma.masked_greater(np.where(np.arange(41)[:, None] < 20, 1.0, 1e6) * np.ones((41, 41)), 1e3)
    moving = heightmap(np.zeros((41, 41)), velocities=speeds)
    np.testing.assert_allclose(moving.at(WHERE, 0.0).velocities, [1.0, 0.0])
    variances = np.ma.masked_equal(np.where(np.arange(41)[:, None] < 20, 1e-4, NO_DATA) * np.ones((41, 41)), NO_DATA)
    fused = heightmap(np.zeros((41, 41)), variance=variances, motion=MotionConfig(changes="correction"))
    np.testing.assert_array_equal(np.isfinite(fused.at(WHERE, 0.0).heights), [True, False])
