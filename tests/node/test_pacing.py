"""The loop's deadlines under load, on a clock of the test's own."""

import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.outputs.rates import Rhythm
from smartmesh_ros.node.timing.pacing import MOST_CATCH_UP, DeadlinePolicy, Pacer
from smartmesh_ros.node.timing.stamps import OLDEST, Placed, StampClock

PERIOD = 1 / 240
POLICIES: tuple[DeadlinePolicy, ...] = ("skip", "catch_up", "slow_down")
costs = st.lists(st.floats(0.0, 5.0 * PERIOD), min_size=1, max_size=200)


class Run(NamedTuple):
    """Starts of the steps [s], simulated time after each [s], that at which each map is placed [s], and the pacer."""

    starts: list[float]
    simulated: list[float]
    placed: list[float]
    pacer: Pacer


def run(policy: DeadlinePolicy, costs: list[float], every: float = math.inf) -> Run:
    """A loop whose steps take these times [s]. Maps come ``every`` so often [s], the first at the first step."""
    now, due = [0.0], 0.0
    pacer = Pacer(PERIOD, policy, lambda: now[0])
    starts, simulated, placed, time = [], [], [], 0.0
    for cost in costs:
        now[0] += max(pacer.remaining(), 0.0)
        starts.append(now[0])
        while due <= now[0]:
            placed.append(pacer.simulated_at(now[0] - due, time))
            due += every
        time += (1 + pacer.advance()) * PERIOD
        simulated.append(time)
        now[0] += cost
    return Run(starts, simulated, placed, pacer)


@pytest.mark.parametrize("policy", POLICIES)
@given(st.lists(st.floats(0.0, 0.99 * PERIOD), min_size=1, max_size=50))
def test_a_loop_that_has_time_keeps_the_beat(policy: DeadlinePolicy, costs: list[float]) -> None:
    result = run(policy, costs)
    assert result.starts == pytest.approx([(i + 1) * PERIOD for i in range(len(costs))])
    assert result.simulated == pytest.approx(result.starts)
    assert result.pacer.misses == 0


@given(costs)
def test_skip_keeps_simulated_time_with_the_clock(costs: list[float]) -> None:
    result = run("skip", costs)
    for start, time in zip(result.starts, result.simulated, strict=True):
        assert -1e-9 <= start - time <= PERIOD + 1e-9
    # What simulated time went on by without a step is exactly what was missed.
    assert result.simulated[-1] == pytest.approx((len(costs) + result.pacer.misses) * PERIOD)


@given(costs, st.integers(200, 400))
def test_catch_up_runs_every_step_and_returns_to_the_beat(costs: list[float], rest: int) -> None:
    assume(sum(costs) < MOST_CATCH_UP)
    result = run("catch_up", [*costs, *[0.5 * PERIOD] * rest])
    assert result.simulated == pytest.approx([(i + 1) * PERIOD for i in range(len(result.simulated))])
    assert result.starts[-1] == pytest.approx(result.simulated[-1])


@given(costs)
def test_slow_down_never_hurries_and_leaves_nothing_out(costs: list[float]) -> None:
    result = run("slow_down", costs)
    assert result.simulated == pytest.approx([(i + 1) * PERIOD for i in range(len(costs))])
    gaps = [after - before for before, after in zip(result.starts, result.starts[1:], strict=False)]
    # Lateness of less than a period is no miss and is made up for; no two steps in a row are both early.
    assert all(gap >= -1e-9 for gap in gaps)
    assert all(one + two >= PERIOD - 1e-9 for one, two in itertools.pairwise(gaps))


def test_a_stall_is_given_up_and_counted() -> None:
    stall = 2.0 * MOST_CATCH_UP
    result = run("catch_up", [stall, *[0.0] * 10])
    assert result.starts[2] - result.starts[1] == pytest.approx(PERIOD)
    assert result.pacer.misses == int((stall - PERIOD) / PERIOD)
    for policy in POLICIES:
        assert run(policy, [10.5 * PERIOD, *[0.0] * 20]).pacer.misses == 9, "alike, whatever follows from it"


@pytest.mark.parametrize("policy", POLICIES)
def test_a_clock_that_is_set_back_starts_the_beat_anew(policy: DeadlinePolicy) -> None:
    now = [100.0]
    pacer = Pacer(PERIOD, policy, lambda: now[0])
    now[0] = 3.0
    assert pacer.remaining() == pytest.approx(PERIOD)
    now[0] += PERIOD
    assert pacer.remaining() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("policy", ["catch_up", "slow_down"])
@given(costs)
def test_a_late_loop_takes_no_map_for_one_of_a_time_far_ahead(policy: DeadlinePolicy, costs: list[float]) -> None:
    """It would stand on the map before that one until it has caught up, which an overloaded loop never does."""
    now = [0.0]
    pacer = Pacer(PERIOD, policy, lambda: now[0])
    time = 0.0
    for cost in costs:
        for _ in range(3):  # maps come while there is time, and just before the step
            late = now[0] - pacer.deadline
            assert pacer.simulated_at(0.0, time) <= time + PERIOD
            if not pacer.overloaded:
                assert pacer.simulated_at(0.0, time) == pytest.approx(time + min(late, PERIOD), abs=1e-12)
            now[0] += 0.5 * max(pacer.remaining(), 0.0)
        now[0] += max(pacer.remaining(), 0.0)
        pacer.advance()
        time += PERIOD
        now[0] += cost
    now[0] += 1.0  # a stall, longer than the last steps tell
    assert pacer.simulated_at(0.0, time) <= time + PERIOD


@pytest.mark.parametrize("follows", [True, False])
@given(costs)
def test_where_simulated_time_keeps_up_maps_hold_for_their_own_time(follows: bool, costs: list[float]) -> None:
    """Steps are left out, or run at once up to the time that another simulator's clock tells."""
    now, time = [0.0], PERIOD  # of the next step: simulated time runs with the clock
    pacer = Pacer(PERIOD, "catch_up" if follows else "skip", lambda: now[0])
    pacer.follows_clock, pacer.most_catch_up = follows, 1.0
    for cost in costs:
        now[0] += cost
        assert pacer.simulated_at(0.0, time) == pytest.approx(now[0])
        assert pacer.simulated_at(0.01, time) == pytest.approx(now[0] - 0.01)
        while pacer.remaining() <= 0.0:
            time += (1 + pacer.advance()) * PERIOD


def gaps(policy: DeadlinePolicy, costs: list[float], every: float) -> NDArray[np.float64]:
    """How far apart the maps of a `run` are placed [s], once the loop has been late for a while."""
    placed = run(policy, costs, every).placed
    return np.diff(placed[len(placed) // 2 :])


def test_long_steps_between_short_ones_do_not_make_the_ground_jolt() -> None:
    """Each fourth step takes long. By the steps' own times, gaps are up to half as long again, or half."""
    found = gaps("catch_up", [0.012, 0.003, 0.003, 0.003] * 200, 1 / 60)
    assert np.abs(found / found.mean() - 1.0).max() < 0.15


@pytest.mark.parametrize("policy", ["catch_up", "slow_down"])
@given(st.floats(1.05, 10.0), st.floats(1.0, 10.0))
def test_maps_are_as_far_apart_for_a_loop_that_is_always_late_as_they_came(
    policy: DeadlinePolicy, cost: float, every: float
) -> None:
    found = gaps(policy, [cost * PERIOD] * 600, every * cost * PERIOD)
    np.testing.assert_allclose(found, every * PERIOD, rtol=1e-6)


def placed_at(clock: StampClock, stamp: float, now: float, gained: float = 0.0) -> Placed:
    """A stamp that arrives ``now`` [s] and is accepted; simulated time is ``gained`` [s] ahead of the node's clock."""
    placed = clock.place(stamp, now, lambda age: now + gained - age)
    clock.accept(placed)
    return placed


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20), st.lists(st.floats(0.0, 0.1), min_size=20, max_size=20))
def test_stamps_of_this_nodes_clock_are_placed_exactly_however_late_they_come(
    ages: list[float], steps: list[float]
) -> None:
    clock, stamp = StampClock(), 100.0
    assert placed_at(clock, stamp, stamp + 0.5 * OLDEST).time == pytest.approx(stamp)
    for age, step in zip(ages, steps, strict=False):
        stamp += step
        placed = placed_at(clock, stamp, stamp + age)
        assert placed.time == pytest.approx(stamp)
        assert placed.lost == pytest.approx(0.0, abs=1e-9)


@given(st.floats(1.5, 1e9), st.lists(st.floats(0.01, 0.1), min_size=2, max_size=20))
def test_stamps_of_another_clock_keep_their_intervals(behind: float, steps: list[float]) -> None:
    clock, now, before = StampClock(), 2e9, None
    for step in steps:
        now += step
        placed = placed_at(clock, now - behind, now, gained=5.0)
        if before is not None:
            assert placed.time - before.time == pytest.approx(step, abs=1e-6)
        assert not placed.own
        before = placed


@given(st.floats(0.0, 5.0), st.floats(0.1, 1e6))
def test_one_stamp_from_ahead_shuts_out_no_others_however_late_they_come(late: float, ahead: float) -> None:
    clock = StampClock()
    for stamp, age in ((1e6, late), (1e6 + 1.0 + ahead, -ahead), (1e6 + 2.0, late), (1e6 + 3.0, late)):
        placed = placed_at(clock, stamp, stamp + age)
    assert not placed.fresh


def test_equal_stamps_are_at_equal_times_whatever_rounding() -> None:
    clock = StampClock()
    first = placed_at(clock, 3.3, 3.4, gained=1000.0 / 3.0)
    for late in np.arange(0.01, 0.5, 0.01).tolist():
        assert placed_at(clock, 3.3, 3.4 + late, gained=1000.0 / 3.0).time == first.time


def test_a_stamp_that_goes_back_is_refused_or_takes_the_last_ones_time() -> None:
    clock = StampClock()
    first = placed_at(clock, 10.0, 10.0)
    with pytest.raises(InputError, match="older than the last one"):
        clock.place(9.9, 10.1, lambda age: 10.1 - age, most=0.05)
    again = clock.place(9.9, 10.1, lambda age: 10.1 - age, most=0.2)
    assert again.stamp == 10.0
    assert again.time == pytest.approx(first.time)


@given(st.floats(2.01, 50.0))
def test_an_output_that_missed_periods_comes_once_and_then_a_period_later(stall: float) -> None:
    rhythm, step, rate = Rhythm(), 0.01, 10.0
    times = np.append(np.arange(100) * step, 0.99 + stall / rate + np.arange(100) * step)
    due = [time for time in times.tolist() if rhythm.is_due(time, rate)]
    assert np.diff(due).min() > 0.5 / rate
    assert len(due) == 20
