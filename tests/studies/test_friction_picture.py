"""The boxes of docs/images/friction.png."""

import pytest

from studies.friction_picture import BODY, GRAVITY, GROUND, ways


def test_each_way_is_short_by_half_of_the_first_step() -> None:
    for (kind, speed), places in ways().items():
        expected = speed**2 / (2.0 * GROUND[kind] * BODY * GRAVITY)
        assert places[-1, 0] == pytest.approx(expected - 0.5 * speed / 240.0, abs=1e-3), f"{kind} at {speed} m/s"
        assert places[-1, 0] == places[-100, 0], "it stands"
