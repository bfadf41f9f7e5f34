"""Laws of contact: their measures on contacts made by hand, what engines tell of contacts, and the study itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.terrain.grid import FloatArray
from studies import laws
from studies.configurations import Configuration
from studies.engines.engine import Contacts
from studies.laws import COURSES, GRAVITY, PRESSED, SLIPS, TRIALS, Residuals, completed, end_in, entered, residuals
from tests.bodies import random_turn, rotation

MU, WEIGHT, DT = 0.4, GRAVITY, 1.0 / 240.0
FALL = GRAVITY * DT**2  # of a body in a step from rest [m]
LEVEL = np.eye(3)
angles = st.floats(-math.pi, math.pi)


def contact(
    velocity: tuple[float, float, float], force: tuple[float, float, float], gap: float = 0.0, axes: FloatArray = LEVEL
) -> Residuals:
    """Residuals of one contact whose velocity and force along two tangents and the normal are given."""
    friction = np.array([force[0], force[1], 0.0]) @ axes
    told = Contacts.of([(0, 0.0, 0.0, 0.0, *axes[2], gap, *(velocity @ axes), force[2], *friction)])
    return residuals(told, WEIGHT, MU, DT)


@given(seed=st.integers(0, 10**6), slip=angles, speed=st.floats(2.0 * SLIPS, 10.0), press=st.floats(0.1, 100.0))
def test_friction_on_the_cone_against_slip_keeps_every_law(seed: int, slip: float, speed: float, press: float) -> None:
    """On ground that is turned anyhow."""
    x, y, axes = math.cos(slip), math.sin(slip), rotation(random_turn(np.random.default_rng(seed)))
    found = contact((speed * x, speed * y, 0.0), (-MU * press * x, -MU * press * y, press), axes=axes)
    assert [float(column[0]) for column in found] == pytest.approx([0, 0, 0, 0, 0, 1, 1], abs=1e-6)


@given(off=st.floats(-3.1, 3.1), share=st.floats(0.01, 2.0))
def test_friction_off_the_slip_is_turned_and_takes_less_power(off: float, share: float) -> None:
    radius = share * MU * WEIGHT
    found = contact((-1.0, 0.0, 0.0), (radius * math.cos(off), radius * math.sin(off), WEIGHT))
    assert found.angles[0] == pytest.approx(abs(off), abs=1e-7)
    assert found.used[0] == pytest.approx(share)
    assert found.dissipated[0] == pytest.approx(share * math.cos(off))
    assert found.beyond[0] == pytest.approx(max(share - 1.0, 0.0))


def test_a_contact_that_sticks_has_no_direction_and_one_that_hardly_presses_does_not_count() -> None:
    found = contact((0.5 * SLIPS, 0.0, 0.0), (0.1, 0.2, WEIGHT))
    assert np.isnan([found.angles[0], found.used[0], found.dissipated[0]]).all()
    assert found.beyond[0] == 0.0
    assert contact((1.0, 0.0, 0.0), (0.0, 0.0, 0.9 * PRESSED * WEIGHT)).used.size == 0


@pytest.mark.parametrize(
    ("gap", "speed", "press", "signorini", "depth"),
    [
        (0.0, 0.0, WEIGHT, 0.0, 0.0),
        (0.5 * FALL, 0.0, WEIGHT, 0.5, 0.0),  # a force at a distance
        (0.5 * FALL, 0.0, 0.2 * WEIGHT, 0.2, 0.0),
        (0.5 * FALL, -0.5 * FALL / DT, WEIGHT, 0.0, 0.0),  # the step closes the gap
        (0.0, 0.3 * FALL / DT, WEIGHT, 0.3, 0.0),  # it leaves the ground and is pressed
        (-2e-3, 1e-3 / DT, WEIGHT, 0.0, 1e-3),
    ],
)
def test_a_contact_has_a_gap_or_a_force(gap: float, speed: float, press: float, signorini: float, depth: float) -> None:
    found = contact((0.0, 0.0, speed), (0.0, 0.0, press), gap)
    assert (found.signorini[0], found.depths[0]) == pytest.approx((signorini, depth), abs=1e-12)
    assert found.normal_speeds[0] == pytest.approx(abs(speed))


def test_what_an_engine_keeps_to_itself_is_what_the_motion_leaves() -> None:
    """A ball of 1 kg that slides; another with two contacts, whose shares of friction nobody knows."""
    untold = (np.nan, np.nan, np.nan)
    rows = [
        (body, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, press, *untold)
        for body, press in ((0, 9.81), (1, 5.0), (1, 4.81))
    ]
    found = completed(Contacts.of(rows), np.array([(-3.0, 1.0, 0.0), (-3.0, 1.0, 0.0)]))
    assert found.frictions_w[0] == pytest.approx([-3.0, 1.0, 0.0])
    assert np.isnan(found.frictions_w[1:]).all()


def test_the_spread_of_ends() -> None:
    assert laws.spread(np.array([(0.0, 0.0, 0.0), (0.0, 3.0, 4.0)])) == pytest.approx((2.5, 5.0))
    assert laws.spread(np.ones((4, 3))) == (0.0, 0.0)


@pytest.fixture(params=laws.competitors(), ids=lambda one: one.name)
def configuration(request: pytest.FixtureRequest) -> Configuration:
    found: Configuration = request.param
    return found


def test_contacts_change_the_momentum_of_their_body_and_move_as_it_does(configuration: Configuration) -> None:
    """Of balls that slip, in each step: their forces, along the normal where an engine tells no friction; their
    velocities by the middle and the spin about it. PhysX moves middles by a little more than their speed."""
    normal = np.array([-math.sin(math.radians(20.0)), 0.0, math.cos(math.radians(20.0))])
    with entered(configuration, TRIALS[0]) as engine:
        for _ in range(24):
            middles, before = engine.positions(), engine.velocities()
            engine.step()
            if (found := engine.contacts()) is None:
                pytest.skip("tells no contacts")
            twists = engine.velocities()
            off = -((twists - before)[:, :3] / DT + (0.0, 0.0, GRAVITY))
            forces = found.normal_forces[:, None] * found.normals_w + np.nan_to_num(found.frictions_w)
            np.add.at(off, found.bodies, forces)
            assert off @ normal == pytest.approx(0.0, abs=0.02)
            if not np.isnan(found.frictions_w).any():
                assert off == pytest.approx(0.0, abs=0.02)
            arms, twists = found.points_w - middles[found.bodies], twists[found.bodies]
            assert found.velocities_w == pytest.approx(twists[:, :3] + np.cross(twists[:, 3:], arms), abs=1e-3)


def test_equal_starts_have_equal_ends(configuration: Configuration) -> None:
    first, second = (end_in(configuration, COURSES[0], np.zeros(3)) for _ in range(2))
    assert (first == second).all()


def test_the_study_compares_all_engines(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the slope and a course, for a moment; the husky in one engine."""
    monkeypatch.setattr(laws, "TRIALS", [replace(one, duration=0.4) for one in TRIALS[:3]])
    monkeypatch.setattr(laws, "COURSES", [replace(COURSES[0], duration=0.1)])
    monkeypatch.setattr(laws, "ROBOTS", {laws.OURS[0].name: laws.ROBOTS[laws.OURS[0].name]})
    residuals_told, drifts = laws.laws(["slope"]), laws.drifts(2)
    for one in laws.competitors():
        assert f"| slope: {one.name} |" in residuals_told
        assert (f"| husky: {one.name} |" in residuals_told) == (one.name in laws.ROBOTS)
        assert f"\n| {one.name} |" in drifts
