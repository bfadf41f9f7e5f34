"""What the ground does between two maps."""

import numpy as np
import pytest

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.motion import PATIENCE, REST, MotionConfig, MotionMode, progress

AGES = np.linspace(0.0, 1.0, 2001)
INTERVAL = 0.1


@pytest.mark.parametrize("mode", ["extrapolate", "interpolate"])
def test_rate_is_the_derivative_of_offset(mode: MotionMode) -> None:
    offset, rate = progress(mode, AGES, np.full_like(AGES, INTERVAL))
    numeric = np.diff(offset) / np.diff(AGES)
    np.testing.assert_allclose(numeric, 0.5 * (rate[1:] + rate[:-1]), atol=0.8)
    assert np.count_nonzero(np.abs(numeric - rate[:-1]) > 1e-9) <= 3  # at the corners only


def test_extrapolation_runs_on_waits_and_returns() -> None:
    offset, rate = progress("extrapolate", AGES, np.full_like(AGES, INTERVAL))
    fresh = AGES <= PATIENCE * INTERVAL
    np.testing.assert_allclose(offset[fresh], AGES[fresh])
    gone = AGES > REST * INTERVAL
    assert np.abs(offset[gone]).max() == 0.0
    assert np.abs(rate[gone]).max() == 0.0
    assert np.abs(np.diff(offset)).max() < 1e-3


def test_interpolation_starts_at_the_map_before_and_ends_at_the_last() -> None:
    offset, rate = progress("interpolate", AGES, np.full_like(AGES, INTERVAL))
    assert offset[0] == -INTERVAL
    assert np.abs(offset[AGES >= INTERVAL]).max() == 0.0
    assert rate[0] == 1.0


def test_hold_keeps_the_heights_and_carries_the_velocity_while_maps_come() -> None:
    offset, rate = progress("hold", AGES, np.full_like(AGES, INTERVAL))
    assert np.abs(offset).max() == 0.0
    assert rate[0] == 1.0
    assert rate[-1] == 0.0


@pytest.mark.parametrize("bad", [{"mode": "guess"}, {"max_interval": 0.0}, {"max_velocity": float("nan")}])
def test_impossible_settings_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(InputError):
        MotionConfig(**bad)  # type: ignore[arg-type]
