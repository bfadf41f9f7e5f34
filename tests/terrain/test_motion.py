"""What the ground does between two maps, sample by sample: properties of the law that the core's reader gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.motion import Mode, MotionConfig
from tests.terrain.motion_law import (
    AT_REST,
    LATE_AFTER,
    REST_AFTER,
    Phase,
    displacement,
    phase_of,
    rise_of,
)

AGES = np.linspace(0.0, 1.0, 2001)
INTERVAL = 0.1

velocities = st.floats(-10.0, 10.0)
accelerations = st.floats(-100.0, 100.0)


def phase_at(age: float, mode: Mode = Mode.EXTRAPOLATE, lag: float = 0.5 * INTERVAL) -> Phase:
    """Of ground whose last map came at time 0 and is due again after an INTERVAL."""
    return phase_of(age, 0.0, INTERVAL, lag, int(mode))


def height_at(age: float, velocity: float, acceleration: float, mode: Mode = Mode.EXTRAPOLATE) -> float:
    return displacement(velocity, acceleration, phase_at(age, mode))


@given(velocities, accelerations, st.floats(0.0, 0.6), st.floats(1e-4, 0.1))
def test_ground_rises_by_the_difference_of_its_heights(v: float, a: float, age: float, ahead: float) -> None:
    """Within one part of its motion: until maps are late, or from then on until it rests."""
    patience = LATE_AFTER * INTERVAL
    if age <= patience < age + ahead:
        ahead = patience - age
    rise = rise_of(v, a, phase_at(age), ahead)
    assert rise == pytest.approx(height_at(age + ahead, v, a) - height_at(age, v, a), abs=1e-9 * (1 + abs(v) + abs(a)))


@given(velocities, accelerations)
@pytest.mark.parametrize("corner", [0.0, INTERVAL, LATE_AFTER * INTERVAL, REST_AFTER * INTERVAL])
def test_ground_jumps_nowhere(corner: float, v: float, a: float) -> None:
    """Not when the map comes, is due, is late or is gone."""
    assert height_at(corner + 1e-9, v, a) == pytest.approx(height_at(corner - 1e-9, v, a), abs=1e-6)


@given(velocities, accelerations, st.floats(LATE_AFTER * INTERVAL + 1e-6, REST_AFTER * INTERVAL), st.floats(0.0, 10.0))
def test_late_ground_returns_to_its_map_and_stays_there(v: float, a: float, age: float, ahead: float) -> None:
    here = height_at(age, v, a)
    there = here + rise_of(v, a, phase_at(age), ahead)
    assert abs(there) <= abs(here) + 1e-9
    assert there * here >= -1e-9


def test_interpolation_starts_at_the_map_before_and_ends_at_the_last() -> None:
    offset = np.array([height_at(age, 1.0, 0.0, Mode.INTERPOLATE) for age in AGES])
    assert offset[0] == -INTERVAL
    assert np.abs(offset[AGES >= INTERVAL]).max() == 0.0
    assert (np.diff(offset) >= 0.0).all()
    assert phase_at(0.0, Mode.INTERPOLATE).rate == 1.0
    assert phase_at(INTERVAL, Mode.INTERPOLATE).rate == 0.0


def test_hold_keeps_the_heights_and_carries_the_velocity_while_maps_come() -> None:
    assert all(height_at(age, 1.0, 5.0, Mode.HOLD) == 0.0 for age in AGES)
    assert phase_at(0.0, Mode.HOLD).rate == 1.0
    assert phase_at(1.0, Mode.HOLD).rate == 0.0


@pytest.mark.parametrize("mode", list(Mode))
def test_ground_of_which_no_map_is_expected_is_at_rest(mode: Mode) -> None:
    assert phase_of(0.3, 0.0, 0.0, 0.05, int(mode)) == AT_REST


@pytest.mark.parametrize(
    "bad",
    [
        {"mode": "guess"}, {"max_interval": 0.0}, {"max_velocity": math.nan}, {"changes": "guess"}, {"settle": 0.0},
        {"noise": math.nan}, {"min_interval": 1.0}, {"min_interval": -1.0},
    ],
)  # fmt: skip
def test_impossible_settings_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(InputError):
        MotionConfig(**bad)  # type: ignore[arg-type]
