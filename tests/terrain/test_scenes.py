"""Scenes move as they say."""

import numpy as np
import pytest
from matplotlib.cbook import get_sample_data

from smartmesh_ros import GridGeometry
from smartmesh_ros.scenes.moving import InwardWaves, Wave, jacksboro_fault
from smartmesh_ros.tools.evaluation.grounds import GROUNDS, make_ground

GRID = GridGeometry(rows=81, columns=121, resolution=0.2)


@pytest.mark.parametrize("kind", [*GROUNDS, "waves on a relief"])
def test_regions_build_the_whole_map_which_is_finite(kind: str) -> None:
    relief = np.random.default_rng(1).normal(size=(81, 121)).astype(np.float32)
    scene = make_ground(GRID, kind) if kind in GROUNDS else InwardWaves(GRID, relief=relief)
    built = scene.heights(0.0).copy()
    for time in np.linspace(0.02, 5.0, 250):
        region = scene.changed(float(time))
        height, width = region.heights.shape
        built[region.row : region.row + height, region.column : region.column + width] = region.heights
        assert np.isfinite(built).all()
    assert built.shape == (81, 121)
    np.testing.assert_allclose(built, scene.heights(5.0), atol=1e-6)


def test_after_a_jump_of_its_clock_a_rut_is_a_whole_circle() -> None:
    """Without the memory and the time that all laps would take."""
    jumped, driven = make_ground(GRID, "rut"), make_ground(GRID, "rut")
    found, expected = jumped.heights(1.7e9), [driven.heights(time) for time in np.arange(0.0, 60.0, 0.1)][-1]
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_waves_run_inwards_at_their_speed() -> None:
    wave = Wave(amplitude=0.3, number=1.0, frequency=2.0)
    scene = InwardWaves(GRID, wave)
    radius = np.hypot(scene.x, scene.y)
    for time in (0.0, 0.7, 3.1):
        expected = 0.3 * np.sin(radius + 2.0 * time)
        np.testing.assert_allclose(scene.heights(time), expected, atol=1e-5)


def test_the_elevation_model_is_real_and_northwards() -> None:
    elevation = jacksboro_fault(relief=10.0)
    assert elevation.shape == (344, 403)
    assert (elevation.min(), elevation.max()) == (0.0, pytest.approx(10.0))
    with get_sample_data("jacksboro_fault_dem.npz") as data:  # its rows run southwards
        np.testing.assert_allclose(84.0 * elevation[::-1] + 236.0, data["elevation"], atol=1e-3)
