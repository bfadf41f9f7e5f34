"""Masked arrays: cells without data are holes, whatever number lies below the mask."""

from typing import Any

import numpy as np
import pytest

from smartmesh_ros import HeightMap, InputError, MotionConfig, World
from smartmesh_ros.io.rasters import RasterConfig, from_grid_map, from_image, from_points
from smartmesh_ros.terrain.trimesh import TriangleMesh

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
@pytest.mark.parametrize("corrects", [False, True])
def test_masked_heights_are_holes(kind: Any, corrects: bool) -> None:
    motion = MotionConfig(changes="correction" if corrects else "motion")
    made = heightmap(masked(kind), motion=motion)
    replaced, updated = heightmap(np.full((41, 41), np.nan), motion=motion), heightmap(masked(kind), motion=motion)
    replaced.replace(masked(kind), time=1.0)
    updated.update_region(0, 0, masked(kind)[:30], time=1.0)
    for ground in (made, replaced, updated):
        with World(ground) as world:
            np.testing.assert_array_equal(world.ground_at(WHERE).z, [0.0, np.nan])


def test_masked_velocities_are_none_and_masked_variances_are_unknown() -> None:
    speeds = np.ma.masked_greater(np.where(np.arange(41)[:, None] < 20, 1.0, 1e6) * np.ones((41, 41)), 1e3)
    moving = heightmap(np.zeros((41, 41)), velocities=speeds)
    np.testing.assert_allclose(moving.at(WHERE, 0.0).velocities, [1.0, 0.0])
    variances = np.ma.masked_equal(np.where(np.arange(41)[:, None] < 20, 1e-4, NO_DATA) * np.ones((41, 41)), NO_DATA)
    fused = heightmap(np.zeros((41, 41)), variance=variances, motion=MotionConfig(changes="correction"))
    np.testing.assert_array_equal(np.isfinite(fused.at(WHERE, 0.0).heights), [True, False])


def test_masks_survive_rasters() -> None:
    config = RasterConfig(scale=0.5, offset=1.0)
    hole = masked(np.int16).mask
    image = from_image(masked(np.int16), config)
    np.testing.assert_array_equal(np.isnan(image.heights[::-1]), hole)
    layer = from_grid_map(masked(), start=(3, 0), centre=(0.0, 0.0), resolution=0.1, config=config, variances=masked())
    assert np.isnan(layer.heights).sum() == np.isnan(layer.variances).sum() == hole.sum()
    y, x = np.mgrid[0:41, 0:41] * 0.1
    cloud = from_points(np.ma.stack([np.ma.array(x), np.ma.array(y), masked()], axis=-1), config)
    np.testing.assert_array_equal(np.isnan(cloud.heights), hole)


def test_a_mesh_has_no_masked_vertices() -> None:
    vertices = np.ma.masked_equal([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, NO_DATA]], NO_DATA)
    with pytest.raises(InputError, match="not finite"):
        TriangleMesh(vertices, [[0, 1, 2]])
    with World(heightmap(np.zeros((41, 41)))) as world, pytest.raises(InputError, match="not finite"):
        world.ground_at(np.ma.masked_equal([[0.0, NO_DATA]], NO_DATA))


def test_a_mask_that_covers_nothing_changes_nothing() -> None:
    assert heightmap(np.ma.array(np.ones((41, 41)))).heights.min() == 1.0
    with World(heightmap(np.ma.array(np.ones((41, 41), int)))) as world:
        assert world.ground_at(np.ma.array([[0, 1]])).z[0] == 1.0
