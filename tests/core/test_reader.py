"""The core's reader of moving maps gives the same bits as the compiled Python that it stands beside."""

from __future__ import annotations

import numpy as np
import pytest

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.motion import CLOCK, KEPT, Mode
from smartmesh_ros.terrain.moving_grid import MovingGrid, samples_at

MAPS = 100  # of each mode, with and without noise
SAMPLES = 125  # of each map; 100,000 in all


def random_clocks(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Returns blocks that were updated once, twice or often, and one after the other."""
    clocks = np.zeros(shape, CLOCK)
    clocks["known"] = rng.integers(0, KEPT + 1, shape)
    clocks["newest"] = rng.integers(0, KEPT, shape)
    clocks["lifetime"] = rng.choice([0.0, 0.01, 0.05, 0.2], shape)
    clocks["time"] = rng.uniform(-1.0, 1.0) + (rng.normal(scale=0.02, size=shape) if rng.random() < 0.5 else 0.0)
    before = clocks["time"]
    for name in ("middle", "middle_1", "middle_2"):
        before = before - rng.uniform(0.002, 0.2)
        clocks[name] = before
    return clocks


def random_grid(mode: Mode, noise: float, rng: np.random.Generator) -> MovingGrid:
    rows, columns = rng.integers(2, 150, 2)
    heights = rng.normal(size=(rows, columns)).astype(np.float32)
    velocities = rng.normal(scale=rng.choice([0.01, 1.0]), size=(KEPT, rows, columns)).astype(np.float32)
    velocities += rng.normal(scale=2.0, size=(KEPT, 1, 1)).astype(np.float32)
    heights[rng.random(heights.shape) < 0.05] = np.nan
    velocities[rng.random(velocities.shape) < 0.02] = np.nan
    velocities[rng.random(velocities.shape) < 0.02] = 1e6
    return MovingGrid(
        heights=heights, velocities=velocities, clocks=random_clocks(rng, ((rows + 63) // 64, (columns + 63) // 64)),
        x=0.0, y=0.0, z=float(rng.normal()), cos=1.0, sin=0.0, resolution=0.1, slide_x=0.0, slide_y=0.0, spin=0.0,
        mode=int(mode), max_velocity=25.0, offsets=rng.normal(size=(rows, columns)).astype(np.float32),
        shown=float(rng.uniform(-2.0, 2.0)), settle=0.2, noise=noise,
    )  # fmt: skip


def core_grid(grid: MovingGrid) -> _core.Grid:
    clocks = grid.clocks.view(np.uint8).reshape(*grid.clocks.shape, CLOCK.itemsize)
    made = _core.Grid(grid.heights, grid.velocities, grid.offsets, clocks)
    made.place(grid.x, grid.y, grid.z, 0.0, grid.resolution)
    made.set_motion(grid.mode, grid.max_velocity, grid.settle, grid.noise, grid.shown)
    return made


@pytest.mark.parametrize("noise", (0.0, 0.01))
@pytest.mark.parametrize("mode", Mode)
def test_samples_and_rises_are_equal_to_the_bit(mode: Mode, noise: float) -> None:
    rng = np.random.default_rng(int(mode))
    for _ in range(MAPS):
        grid = random_grid(mode, noise, rng)
        made, columns = core_grid(grid), grid.heights.shape[1]
        time, ahead = float(rng.uniform(-1.5, 2.0)), float(rng.choice([1e-9, 1 / 240, 0.1]))
        indices = rng.integers(0, grid.heights.size, SAMPLES)
        heights, velocities = np.empty(SAMPLES), np.empty(SAMPLES)
        # Compiled code keeps differences of float32 velocities in float32; the core computes in float64.
        precise = grid._replace(velocities=grid.velocities.astype(np.float64))
        samples_at(precise, indices, time, ahead, heights, velocities)
        found = np.array([made.sample(int(i // columns), int(i % columns), time, ahead) for i in indices])
        np.testing.assert_array_equal(found[:, 0], heights)
        np.testing.assert_array_equal(found[:, 1] / ahead, velocities)
