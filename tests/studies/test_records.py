"""The records: what is measured is right where closed forms say what it is, in every engine that is installed."""

import math

import pytest

from studies.engines.engine import Setup
from studies.records.cells import GRAVITY, lowest, run, setup_of
from studies.records.entrants import OURS, RATE, enter, entrants
from studies.records.tax import BALL, BOX, Crowd
from studies.records.tax import setup_of as crowd_on
from studies.records.touchdown import rebound, speed_at_deck


@pytest.mark.parametrize("case", ["still", "driving"])
@pytest.mark.parametrize(("kind", "half"), [("ball", BALL.radius), ("box", 0.5 * BOX.z)])
@pytest.mark.parametrize("name", entrants())
def test_plane_and_field_are_the_same_ground(name: str, kind: str, half: float, case: str) -> None:
    """Bodies stay on both, and those that drive go on at 1 m/s, on fields at least ours."""
    for plane in (True, False):
        setup: Setup = crowd_on(Crowd(kind, 4), case, plane)
        with enter(name, setup) as engine:
            start = engine.positions()
            for _ in range(RATE // 4):
                engine.step()
            moved = engine.positions() - start
        assert abs(moved[:, 2]).max() < 0.005
        if plane or name == OURS:
            assert moved[:, 0] == pytest.approx((0.2 if case == "driving" else 0.0), abs=0.004)
    assert start[:, 2] == pytest.approx(half)


def test_a_parabola_meets_a_deck_with_the_speed_of_ballistics() -> None:
    """A deck that rises at 0.5 m/s, and a ball from 2 m above it; the engine's own speed lags half a step."""
    lag = 0.5 * GRAVITY / RATE
    met = speed_at_deck(lambda time: 0.5 * time, 0.0, 2.0, lag)
    assert met == pytest.approx(-math.sqrt(0.5**2 + 2.0 * GRAVITY * 2.0), rel=1e-6)
    gap, up = 0.3, 3.0
    left = speed_at_deck(lambda _: 0.0, 1.0, gap, up + lag)
    assert left == pytest.approx(math.sqrt(up**2 + 2.0 * GRAVITY * gap), rel=1e-6)


def test_a_ball_keeps_e_times_the_relative_speed_where_the_ground_has_a_velocity() -> None:
    for phase in (0.0, 0.5 * math.pi, math.pi):
        assert rebound(OURS, 0.6, phase) == pytest.approx(0.6, rel=0.02)
    assert rebound("PyBullet", 0.6, 0.0) < 0.5 < 1.0 < rebound("PyBullet", 0.6, math.pi)


@pytest.mark.parametrize("kind", ["balls", "boxes"])
def test_bodies_on_the_slope_obey_closed_forms(kind: str) -> None:
    with enter(OURS, setup_of(kind, 0.1)) as engine:
        assert lowest(kind, engine.poses()) == pytest.approx(0.0, abs=1e-6)
        found = run(engine, kind)
    assert found.depth < 0.05
    assert found.force < 0.1
