"""The core's reader of moving maps tells the same of a sample, whichever way it is asked."""

import numpy as np
import pytest

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.motion import CLOCK, KEPT, Mode

MAPS = 50  # of each mode


def random_clocks(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Returns blocks that were updated once, twice or often, and one after the other."""
    clocks = np.zeros(shape, CLOCK).view(np.recarray)
    clocks["known"] = rng.integers(0, KEPT + 1, shape)
    clocks["newest"] = rng.integers(0, KEPT, shape)
    clocks["lifetime"] = rng.choice([0.0, 0.01, 0.05, 0.2], shape)
    clocks["time"] = rng.uniform(-1.0, 1.0) + (rng.normal(scale=0.02, size=shape) if rng.random() < 0.5 else 0.0)
    before = clocks["time"]
    for name in ("middle", "middle_1", "middle_2"):
        before = before - rng.uniform(0.002, 0.2)
        clocks[name] = before
    clocks["since"] = clocks["time"] + rng.uniform(-0.05, 0.1)
    clocks["until"] = clocks["since"] + rng.choice([0.0, 1.0, 4.0]) * clocks["lifetime"]
    return clocks


def random_grid(mode: Mode, noise: float, rng: np.random.Generator) -> _core.Grid:
    rows, columns = rng.integers(2, 150, 2).tolist()
    made = _core.Grid(rows, columns)
    made.clocks.view(CLOCK)[..., 0] = random_clocks(rng, made.clocks.shape[:2])
    made.heights[...], made.offsets[...], made.rates[...] = rng.normal(size=(3, rows, columns))
    made.velocities[...] = rng.normal(scale=rng.choice([0.01, 1.0]), size=(KEPT, rows, columns))
    made.velocities[...] += rng.normal(scale=2.0, size=(KEPT, 1, 1))
    made.heights[rng.random((rows, columns)) < 0.05] = np.nan
    for value in (np.nan, 1e6):
        made.velocities[rng.random(made.velocities.shape) < 0.02] = value
    made.place(0.0, 0.0, rng.normal(), 0.0, 0.1)
    made.set_motion(int(mode), 25.0, 0.2, noise, float(rng.choice([0.0, 4.0])))
    made.show(rng.uniform(-2.0, 2.0))
    return made


@pytest.mark.parametrize("noise", (0.0, 0.01))
@pytest.mark.parametrize("mode", Mode)
def test_windows_and_lists_are_their_samples_to_the_bit(mode: Mode, noise: float) -> None:
    """Across blocks whose clocks differ and beyond the edge."""
    rng = np.random.default_rng(10 + int(mode))
    for _ in range(MAPS):
        made, time = random_grid(mode, noise, rng), float(rng.uniform(-1.5, 2.0))
        rows, columns = made.heights.shape
        row, column = (int(rng.integers(-8, size + 8)) for size in (rows, columns))
        window = np.empty(rng.integers(0, 80, 2))
        _core.grid_window(made, row, column, time, window)
        expected = [
            [made.sample(row + a, column + b, time, 1.0)[0] for b in range(window.shape[1])]
            for a in range(window.shape[0])
        ]
        np.testing.assert_array_equal(window, np.reshape(expected, window.shape))
        indices, ahead = rng.integers(0, rows * columns, 50), float(rng.choice([1e-9, 1 / 240, 0.1]))
        heights, velocities = _core.sample_grid(made, indices, time, ahead)
        samples = [made.sample(*divmod(index, columns), time, ahead) for index in indices.tolist()]
        np.testing.assert_array_equal(np.stack([heights, velocities], axis=1), samples / np.array([1.0, ahead]))
