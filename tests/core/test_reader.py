"""The core's reader of moving maps gives the law of their motion to the bit."""

from types import SimpleNamespace

import numpy as np
import pytest

from smartmesh_ros import GridGeometry
from smartmesh_ros.core import _core
from smartmesh_ros.terrain.grid_track import RigidMotion, moved_on
from smartmesh_ros.terrain.motion import CLOCK, KEPT, Mode
from tests.terrain.motion_law import phase_of, sample_at

MAPS = 50  # of each mode
SAMPLES = 50  # of each map; 10,000 in all


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


def random_grid(mode: Mode, noise: float, rng: np.random.Generator) -> SimpleNamespace:
    """Returns arrays and settings as those of the core's grid."""
    rows, columns = rng.integers(2, 150, 2)
    heights = rng.normal(size=(rows, columns)).astype(np.float32)
    velocities = rng.normal(scale=rng.choice([0.01, 1.0]), size=(KEPT, rows, columns)).astype(np.float32)
    velocities += rng.normal(scale=2.0, size=(KEPT, 1, 1)).astype(np.float32)
    heights[rng.random(heights.shape) < 0.05] = np.nan
    velocities[rng.random(velocities.shape) < 0.02] = np.nan
    velocities[rng.random(velocities.shape) < 0.02] = 1e6
    return SimpleNamespace(
        heights=heights, velocities=velocities, clocks=random_clocks(rng, ((rows + 63) // 64, (columns + 63) // 64)),
        offsets=rng.normal(size=(rows, columns)).astype(np.float32), z=float(rng.normal()), mode=int(mode),
        rates=rng.normal(size=(rows, columns)).astype(np.float32), max_velocity=25.0,
        shown=float(rng.uniform(-2.0, 2.0)), settle=0.2, noise=noise, smoothing=float(rng.choice([0.0, 4.0])),
    )  # fmt: skip


def core_grid(grid: SimpleNamespace) -> _core.Grid:
    made = _core.Grid(*grid.heights.shape)
    made.clocks.view(CLOCK)[..., 0] = grid.clocks
    for name in ("heights", "velocities", "offsets", "rates"):
        getattr(made, name)[...] = getattr(grid, name)
    made.place(0.0, 0.0, grid.z, 0.0, 0.1)
    made.set_motion(grid.mode, grid.max_velocity, grid.settle, grid.noise, grid.smoothing)
    made.show(grid.shown)
    return made


@pytest.mark.parametrize("mode", Mode)
def test_samples_and_rises_are_equal_to_the_bit(mode: Mode) -> None:
    rng = np.random.default_rng(int(mode))
    for _ in range(MAPS):
        grid = random_grid(mode, 0.0, rng)
        made, columns = core_grid(grid), grid.heights.shape[1]
        time, ahead = float(rng.uniform(-1.5, 2.0)), float(rng.choice([1e-9, 1 / 240, 0.1]))
        indices = rng.integers(0, grid.heights.size, SAMPLES)
        expected = np.array([sample_at(grid, *divmod(int(i), columns), time, ahead) for i in indices])
        found = np.array([made.sample(*divmod(int(i), columns), time, ahead) for i in indices])
        np.testing.assert_array_equal(found, expected)
        heights, velocities = np.empty(SAMPLES), np.empty(SAMPLES)
        _core.sample_grid(made, indices, time, ahead, heights, velocities)
        np.testing.assert_array_equal(np.stack([heights, velocities], axis=1), expected / (1.0, ahead))


@pytest.mark.parametrize("noise", (0.0, 0.01))
@pytest.mark.parametrize("mode", Mode)
def test_windows_are_their_samples_to_the_bit(mode: Mode, noise: float) -> None:
    """Across blocks whose clocks differ and beyond the edge."""
    rng = np.random.default_rng(10 + int(mode))
    for _ in range(MAPS):
        grid = random_grid(mode, noise, rng)
        made, time = core_grid(grid), float(rng.uniform(-1.5, 2.0))
        row, column = (int(rng.integers(-8, size + 8)) for size in grid.heights.shape)
        window = np.empty(rng.integers(0, 80, 2))
        _core.grid_window(made, row, column, time, window)
        expected = [
            [made.sample(row + a, column + b, time, 1.0)[0] for b in range(window.shape[1])]
            for a in range(window.shape[0])
        ]
        np.testing.assert_array_equal(window, np.reshape(expected, window.shape))


@pytest.mark.parametrize("mode", Mode)
def test_a_grid_that_moves_is_where_its_track_leads(mode: Mode) -> None:
    rng = np.random.default_rng(int(mode))
    for _ in range(MAPS):
        made = core_grid(random_grid(mode, 0.0, rng))
        x, y, yaw, last = rng.normal(size=4).tolist()
        motion, interval = RigidMotion(*rng.normal(size=3).tolist()), float(rng.uniform(0.01, 0.2))
        made.place(x, y, 0.0, yaw, 0.1)
        made.move(last, interval, *motion)
        time = last + float(rng.uniform(-0.1, 0.6))
        phase = phase_of(time, last, interval, 0.0, int(mode))
        geometry = GridGeometry(rows=3, columns=3, resolution=0.1, origin=(x, y, 0.0), yaw=yaw)
        at_x, at_y, turned = moved_on(geometry, motion, phase.along)
        turn = motion.spin * phase.along
        slide = complex(motion.x, motion.y) * complex(np.cos(turn), np.sin(turn)) * phase.rate
        expected = (
            at_x, at_y, np.cos(turned), np.sin(turned), slide.real, slide.imag, motion.spin * phase.rate
        )  # fmt: skip
        np.testing.assert_allclose(_core.grid_pose(made, time), expected, rtol=1e-12, atol=1e-15)
