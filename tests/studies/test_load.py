"""The load study: what it sends is what it says, a case runs from end to end, and a slope is that of a line."""

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header

from smartmesh_ros.node.parameters.specifications import NAMES
from studies.load import soak
from studies.load.driver import CODES, RESOLUTION, RISE, WAVE, Case, TerrainMessages, groups, run_case
from studies.load.soak import is_flat, slope_of
from studies.load.study import runs, summary_of

SMALL = Case(side=128, bodies=3, mode="regions", map_rate=30.0, physics_rate=120.0, seconds=2.5)


def test_every_case_is_another_with_parameters_that_the_node_knows() -> None:
    for members in groups().values():
        assert len(set(members)) == len(members)
        assert all(set(case.parameters()) <= set(NAMES) for case in members)
        assert all(case.window <= case.side for case in members)


@given(st.integers(0, 100), st.floats(0.0, 100.0))
def test_maps_and_regions_are_the_wave_with_a_code_that_comes_round(k: int, time: float) -> None:
    messages = TerrainMessages(SMALL)
    whole, region = (messages.message(k, time, Time(sec=int(time)), whole=one) for one in (True, False))
    side = SMALL.window
    part = np.reshape(whole.heights, (SMALL.side, SMALL.side))[:side, :side]
    np.testing.assert_array_equal(np.reshape(region.heights, (side, side)), part)
    assert whole.header == region.header == Header(frame_id="map", stamp=Time(sec=int(time)))
    x, y = np.array(SMALL.probe) / RESOLUTION
    assert part[round(y), round(x)] == pytest.approx(RISE * (k % CODES))
    amplitude, wave_number, frequency = WAVE
    row, column = side // 2, 10
    expected = amplitude * math.sin(wave_number * column * RESOLUTION - frequency * time)
    assert part[row, column] == pytest.approx(expected, abs=1e-6)


def test_a_case_runs_between_processes_and_says_what_happened(domain: int) -> None:
    result = run_case(SMALL)
    summary = summary_of(result)
    assert summary.lost == 0
    assert result["sent"] == pytest.approx(SMALL.map_rate * SMALL.seconds, rel=0.3)
    assert 0.0 < summary.latencies[0] <= summary.latencies[-1]
    median, high, most = summary.stages["total"]
    assert 0.0 < summary.stages["step"][0] < median <= high <= most
    assert summary.cpu_per_step > 0.0
    assert 0.0 < summary.real_time_factor < 1.2
    assert 0.0 <= summary.missed <= 1.0
    assert summary.memory["resident"] > summary.memory["shared"] > 0.0
    assert runs([summary]).count("\n") == 2


@given(st.floats(-100.0, 100.0), st.floats(0.0, 100.0))
def test_the_slope_of_a_line_is_its_own_and_what_stays_is_flat(per_hour: float, start: float) -> None:
    times = np.arange(600.0)
    slope = slope_of(times, start + per_hour * times / 3600.0)
    assert slope.per_hour == pytest.approx(per_hour, abs=1e-6)
    assert slope.error == pytest.approx(0.0, abs=1e-6)
    assert slope_of(times, np.full(600, start)) == (0.0, 0.0, start)
    noise = 0.01 * np.random.default_rng(1).standard_normal(600)
    assert not is_flat(slope_of(times, 1.0 + noise + 10.0 * times / 3600.0))


def test_a_soak_that_is_too_short_for_a_slope_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patched, pytest.raises(SystemExit):
        patched.setattr(soak, "run", lambda _: pytest.fail("it began"))
        soak.main(["--minutes", "0"])
    assert "'0' is no number from 1 to" in capfd.readouterr().err
