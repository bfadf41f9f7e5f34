"""Scores of maps whose errors are known."""

import math

import numpy as np
import pytest

from smartmesh_ros import GridGeometry
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.tools.score.scorer import ScoreConfig, Scorer

TRUE = GridGeometry(rows=31, columns=41, resolution=0.1, origin=(-2.0, -1.5, 0.0))
PERIOD = 4.0


def ground(grid: GridGeometry, time: float, *, heave: float = 0.3) -> np.ndarray:
    x, y = np.moveaxis(grid.to_world(*np.mgrid[: grid.rows, : grid.columns]), -1, 0)
    return np.asarray(0.2 * x - 0.1 * y + heave * math.sin(math.tau * time / PERIOD))


def run(scorer: Scorer, grid: GridGeometry, lag: float, bias: float, *, heave: float = 0.3, noise: float = 0.0) -> list:
    """Scores of maps at 10 Hz, which come 0.23 s late, against truth at 25 Hz."""
    random, scores = np.random.default_rng(0), []
    for tick in range(200):
        time = 0.04 * tick
        scorer.add_truth(time, Raster(TRUE, ground(TRUE, time, heave=heave)))
        if tick % 2 == 0 and time > 0.5:
            stamp = time - 0.23
            heights = ground(grid, stamp - lag, heave=heave) + random.normal(bias, noise, (grid.rows, grid.columns))
            heights[:3, :4] = np.nan
            scorer.add_map(stamp, Raster(grid, heights.astype(np.float32)))
        scores += scorer.take()
    return scores


@pytest.mark.parametrize("lag", [0.0, 0.13, 0.5])
@pytest.mark.parametrize("resolution", [0.07, 0.1, 0.25])
def test_lag_bias_and_rmse_of_a_map_on_any_grid_are_those_it_was_given(lag: float, resolution: float) -> None:
    grid = GridGeometry(rows=14, columns=12, resolution=resolution, origin=(-0.513, -0.4, 0.0))
    scores = run(Scorer(), grid, lag, bias=0.02)
    for score in scores:
        turns = score.stamp / PERIOD
        off = 0.3 * (math.sin(math.tau * (turns - lag / PERIOD)) - math.sin(math.tau * turns)) + 0.02
        assert score.rmse == pytest.approx(abs(off), abs=2e-4)
        assert score.bias == pytest.approx(off, abs=2e-4)
        assert score.delay == pytest.approx(0.23)
        x, y = np.moveaxis(TRUE.to_world(*np.mgrid[:31, :41]), -1, 0)
        row, column = (y + 0.4) / resolution, (x + 0.513) / resolution
        known = (row >= -0.5) & (row <= 13.5) & (column >= -0.5) & (column <= 11.5) & ~((row < 2.5) & (column < 3.5))
        assert score.covered == pytest.approx(known.mean(), abs=0.02)
    assert math.isnan(scores[0].lag)  # the truth of before is not known yet
    assert scores[-1].lag == pytest.approx(lag, abs=2e-3)
    assert scores[-1].spread < 5e-4


def test_noise_is_left_at_the_lag_and_ground_at_rest_has_none() -> None:
    moving, resting = (run(Scorer(), TRUE, 0.3, 0.0, heave=heave, noise=0.05)[-1] for heave in (0.3, 0.0))
    assert moving.lag == pytest.approx(0.3, abs=0.01)
    assert moving.spread == pytest.approx(0.05, rel=0.03)
    assert math.isnan(resting.lag)
    assert math.isnan(run(Scorer(ScoreConfig(longest_lag=0.2)), TRUE, 0.7, 0.0)[-1].lag), "longer than is tried"
    assert resting.rmse == pytest.approx(0.05, rel=0.1)


def test_maps_wait_for_their_truth_also_after_the_clock_went_back() -> None:
    """Which ones are refused: tests/node/test_ground_maps.py."""
    scorer, level = Scorer(), Raster(TRUE, np.zeros((31, 41), np.float32))
    scorer.add_truth(10.0, level)
    scorer.add_map(10.5, level)
    assert scorer.take() == []
    scorer.add_truth(11.0, level)
    [score] = scorer.take()
    assert (score.rmse, score.covered, score.delay) == (0.0, 1.0, -0.5)
    scorer.add_truth(1.0, level)
    scorer.add_map(1.0, level)
    assert [score.stamp for score in scorer.take()] == [1.0]


def test_a_map_is_scored_by_the_true_maps_before_and_after_it_however_far_apart() -> None:
    scorer = Scorer()
    for tick in range(4):
        scorer.add_truth(10.0 * tick, Raster(TRUE, np.full((31, 41), tick, np.float32)))
        assert [score.bias for score in scorer.take()] == [pytest.approx(0.15)] * bool(tick)
        scorer.add_map(10.0 * tick + 0.5, Raster(TRUE, np.full((31, 41), tick + 0.2, np.float32)))
