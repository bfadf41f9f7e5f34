"""Soil against closed forms: plates, a towed wheel and a sled."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import InputError
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soils import soil_named, soils_of
from studies.soil.trials import TOWED, PlateTrial, TowedWheel, plate_sinkage, sled_shear, wheel_sinkage, wheel_work

SOILS = sorted(soils_of())


@pytest.mark.parametrize("name", SOILS)
@pytest.mark.parametrize("spacing", [0.005, 0.01, 0.02, 0.04])
def test_a_plate_sinks_as_bekker_says(name: str, spacing: float) -> None:
    for pressure in (5e3, 10e3, 20e3):
        trial = PlateTrial(name, spacing=spacing)
        trial.press(pressure, 1.5)
        assert trial.sinkage == pytest.approx(plate_sinkage(soil_named(name), 0.1, pressure), rel=0.03, abs=2e-5)


@settings(max_examples=20, deadline=None)
@given(
    yaw=st.floats(0.0, math.pi), x=st.floats(0.28, 0.32), y=st.floats(0.28, 0.32), spacing=st.sampled_from([0.01, 0.02])
)
def test_a_plate_sinks_as_far_wherever_it_lies(yaw: float, x: float, y: float, spacing: float) -> None:
    trial = PlateTrial("dry_sand", spacing=spacing, place=(x, y), yaw=yaw)
    trial.press(10e3, 1.0)
    assert trial.sinkage == pytest.approx(plate_sinkage(soil_named("dry_sand"), 0.1, 10e3), rel=0.05)


@pytest.mark.parametrize(("name", "millimetres"), [("dry_sand", 10.27), ("clay", 0.15), ("lunar", 11.99)])
def test_the_closed_form_of_the_plate_gives_published_figures(name: str, millimetres: float) -> None:
    assert 1e3 * plate_sinkage(soil_named(name), 0.1, 10e3) == pytest.approx(millimetres, rel=0.02)


@pytest.mark.parametrize("name", ["dry_sand", "lunar", "chrono_rig"])
@pytest.mark.parametrize("spacing", [0.005, 0.01])
def test_a_towed_wheel_sinks_as_the_integral_says_and_its_resistance_is_the_work(name: str, spacing: float) -> None:
    wheel = TowedWheel(name, spacing=spacing)
    wheel.roll(0.3)
    soil = soil_named(name)
    assert wheel.sinkage == pytest.approx(wheel_sinkage(soil, TOWED), rel=0.05)
    assert wheel.resistance == pytest.approx(wheel_work(soil, TOWED, wheel.sinkage), rel=0.05)


@pytest.mark.parametrize("name", SOILS)
def test_a_sled_shears_as_janosi_says(name: str) -> None:
    trial = PlateTrial(name, spacing=0.02)
    trial.press(10e3, 1.0)
    for pulled in (5e-3, 5e-3, 20e-3):
        trial.press(10e3, 0.5, pull=pulled / 0.5)
        wanted = sled_shear(soil_named(name), 10e3, trial.pulled)
        assert trial.shear == pytest.approx(wanted, rel=0.03)


def test_unloaded_soil_recovers_elastically_and_sinks_again_to_the_same_depth() -> None:
    trial = PlateTrial("lunar", spacing=0.02)
    trial.press(10e3, 1.0)
    deep = trial.sinkage
    trial.press(0.0, 0.5)
    soil = soil_named("lunar")
    assert deep - trial.rut == pytest.approx(10e3 / soil.elastic_K, rel=0.05)
    trial.press(8e3, 0.5)
    assert trial.sinkage == pytest.approx(deep - 2e3 / soil.elastic_K, abs=3e-6)
    trial.press(15e3, 1.0)
    assert trial.sinkage == pytest.approx(plate_sinkage(soil, 0.1, 15e3), rel=0.03)


def test_displaced_soil_is_conserved_and_slides_to_its_angle_of_repose() -> None:
    config = SoilConfig(load_time=0.0, still=1e-6, flow=1.0, slides=10)
    trial = PlateTrial("lunar", spacing=0.01, config=config)
    trial.press(20e3, 1.0)
    trial.press(0.0, 1.0)
    heights = trial.map.heights.astype(np.float64)
    moved = np.abs(heights).sum()
    assert moved * 0.01**2 > 1e-4
    assert abs(heights.sum()) < 1e-3 * moved
    layer = trial.soil.layer
    free = layer.plastic == 0.0
    slopes = np.abs(np.diff(heights, axis=1))[free[:, 1:] & free[:, :-1]] / 0.01
    assert slopes.max() < math.tan(math.radians(config.repose)) + 0.05


def test_ground_that_nobody_touches_does_not_move() -> None:
    rng = np.random.default_rng(3)
    trial = PlateTrial("lunar", spacing=0.02, rough=0.02 * rng.standard_normal((61, 61)))
    before = trial.map.heights.copy()
    trial.press(20e3, 1.0)
    away = np.hypot(*(np.indices(before.shape) * 0.02 - 0.3)) > 0.13
    assert np.array_equal(trial.map.heights[away], before[away])
    assert not np.array_equal(trial.map.heights, before)


def test_two_runs_are_equal_to_the_bit() -> None:
    found = []
    for _ in range(2):
        trial = PlateTrial("dry_sand", spacing=0.01, config=SoilConfig(flow=0.7, slides=3), yaw=0.4)
        trial.press(20e3, 0.5)
        found.append(trial.map.heights.tobytes())
    assert found[0] == found[1]


def test_twice_the_region_gives_the_same_answer() -> None:
    found = []
    for rim, side in ((2, 0.6), (4, 1.2)):
        trial = PlateTrial("dry_sand", spacing=0.01, side=side, config=SoilConfig(load_time=0.0, flow=1.0, rim=rim))
        trial.press(10e3, 1.0)
        found.append(trial.sinkage)
    assert found[1] == pytest.approx(found[0], rel=0.01)


def test_ground_that_others_replace_is_new_soil() -> None:
    trial = PlateTrial("lunar", spacing=0.02)
    trial.press(10e3, 1.0)
    trial.map.replace(np.full(trial.map.heights.shape, 0.5), time=trial.time)
    trial.press(10e3, 1.0)
    deep = 0.5 - float(trial.map.at([trial.place], trial.time).heights[0])
    assert deep == pytest.approx(plate_sinkage(soil_named("lunar"), 0.1, 10e3), rel=0.03)


def test_a_map_of_soils_gives_each_place_its_own() -> None:
    kinds = np.zeros((31, 61), np.uint8)
    kinds[:, 31:] = 1
    for place, name in (((0.3, 0.3), "dry_sand"), ((0.9, 0.3), "lunar")):
        trial = PlateTrial(["dry_sand", "lunar"], spacing=0.02, kinds=kinds, place=place)
        trial.press(10e3, 1.0)
        assert trial.sinkage == pytest.approx(plate_sinkage(soil_named(name), 0.1, 10e3), rel=0.03)


def test_another_map_of_soils_may_come_later() -> None:
    trial = PlateTrial(["dry_sand", "lunar"], spacing=0.02)
    trial.soil.set_kinds(np.ones(trial.map.heights.shape, np.uint8))
    trial.press(10e3, 1.0)
    assert trial.sinkage == pytest.approx(plate_sinkage(soil_named("lunar"), 0.1, 10e3), rel=0.03)
    with pytest.raises(InputError, match="kinds"):
        trial.soil.set_kinds(np.full(trial.map.heights.shape, 2))


def test_a_load_beside_the_middle_makes_the_plate_lean() -> None:
    trial = PlateTrial("lunar", spacing=0.01, config=SoilConfig(load_time=0.0, lean_time=0.0, still=1e-6))
    trial.press(10e3, 1.0, aside=0.01)
    heights = trial.map.heights
    row, left, right = 30, 26, 34
    assert heights[row, right] < heights[row, left] - 1e-3  # the load is towards +x
