"""Maps of sensors and mappers are told from those of ground that moves: what is seen in them, and no false alarm."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from smartmesh_ros import GridGeometry, HeightMap, MotionConfig
from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.noise_check import NO_FINDINGS, NoiseCheck
from smartmesh_ros.tools.evaluation.grounds import make_ground
from smartmesh_ros.tools.evaluation.scene import Scene, read_scenes
from studies.matrix.arena import square
from studies.matrix.moving_ground import WAVES
from studies.matrix.real_maps import STAMPS, stamps_of

Feed = Iterable[tuple[float, GridGeometry, NDArray[Any]]]  # time [s], geometry, heights [m]
GRID = square(61, 0.1)
# Hills under the maps: still ground is seldom level.
HILLS = np.asarray(make_ground(GRID, "sinusoid", amplitude=0.2, wavelength=2.0).heights(0.0), np.float64)
SEA_GRID = square(61, 0.25)
SEA = make_ground(SEA_GRID, **WAVES[4])
# A warning comes within so long [s].
SOON = 5.0


def check_of(feed: Feed, motion: MotionConfig | None = None) -> NoiseCheck:
    """A check that has looked at all maps of a feed."""
    check = NoiseCheck()
    for time, geometry, heights in feed:
        check.take(HeightMap(heights, geometry=geometry, time=time, motion=motion), time)
    return check


def of_mapper(
    seconds: float, rate: float, noise: float = 0.0, drift: float = 0.0, closure: float = 0.0, every: float = 2.0
) -> Feed:
    """Maps of still hills with white noise [m], drift [m/s], and closures of a height [m], up and down in turns."""
    rng = np.random.default_rng(1)
    for number in range(round(seconds * rate)):
        time = number / rate
        level = drift * time + closure * (math.floor(time / every + 1e-9) % 2)
        yield time, GRID, HILLS + level + rng.normal(0.0, noise, HILLS.shape)


def of_ground(heights: Callable[[float], NDArray[Any]], geometry: GridGeometry, stamps: Iterable[float]) -> Feed:
    """Exact maps of ground at so many ``stamps`` [s]."""
    for time in stamps:
        yield time, geometry, heights(time)


def at_rate(rate: float, seconds: float = 4.0, most: int = 120) -> list[float]:
    """Even stamps [s]."""
    return [number / rate for number in range(min(round(seconds * rate), most))]


@pytest.mark.parametrize("rate", [5.0, 20.0, 240.0])
@pytest.mark.parametrize(
    ("noise", "closure", "drift"),
    [(0.005, 0.0, 0.0), (0.0, 0.08, 0.0), (0.005, 0.08, 0.0), (0.005, 0.08, 0.01), (0.0, 0.0, 0.01)],
)
def test_noise_and_closures_are_seen_within_five_seconds_and_measured_and_drift_is_motion(
    rate: float, noise: float, closure: float, drift: float
) -> None:
    findings = check_of(of_mapper(SOON, rate, noise=noise, drift=drift, closure=closure)).findings
    assert findings.noise == pytest.approx(noise, rel=0.15)
    assert findings.jump == pytest.approx(closure, rel=0.1)
    assert (f"noise of {1e3 * findings.noise:.1f} mm" in str(findings)) == (noise > 0.0)
    assert (f"jumps of still ground by up to {1e2 * findings.jump:.1f} cm" in str(findings)) == (closure > 0.0)


def test_noise_that_was_told_of_is_not_warned_of() -> None:
    feed = list(of_mapper(SOON, 10.0, noise=0.005, closure=0.08))
    findings = check_of(feed, MotionConfig(noise=0.005)).findings
    assert findings.noise == 0.0
    assert findings.jump == pytest.approx(0.08, rel=0.1)


def test_what_is_not_seen_any_more_is_forgotten_after_a_while() -> None:
    for count, is_forgotten in ((200, False), (500, True)):
        still = of_ground(lambda _: HILLS, GRID, (SOON + 0.1 * number for number in range(count)))
        found = check_of(chain(of_mapper(SOON, 10.0, noise=0.005), still)).findings
        assert (found == NO_FINDINGS) == is_forgotten


def of_scene(scene: Scene) -> Feed:
    ground = scene.make_ground()
    for time in at_rate(scene.map_rate, max(scene.duration, 3.0), 30 if scene.grid[0] > 500 else 180):
        x, y = scene.slide[0] * time, scene.slide[1] * time
        yield time, replace(scene.geometry, origin=(x, y, 0.0)), ground.heights(time)


def of_motion(rate: float, kind: str, **settings: float) -> Feed:
    """Ground at rest for 1.5 s, then in motion, then at rest again."""
    geometry = square(41, 0.25)
    ground = make_ground(geometry, kind, **settings)
    return of_ground(lambda time: ground.heights(max(time - 1.5, 0.0)), geometry, at_rate(rate, 5.0, 720))


def with_a_gap(lost: int) -> Feed:
    """The publisher of the README, 30 maps a second, some of whose maps are missing."""
    x = np.tile(np.linspace(-5.0, 5.0, 61), (61, 1))
    stamps = (number / 30 for number in range(180) if not 90 <= number < 90 + lost)
    return of_ground(lambda time: 0.3 * np.sin(x + 4.0 * time), GRID, stamps)


def of_a_messy_patch() -> Feed:
    """A patch of 0.6 m under a wheel, a hundredth of the map, changes at random."""
    rng = np.random.default_rng(4)
    for time in at_rate(30.0):
        heights = HILLS.copy()
        heights[20:26, 30:36] += rng.normal(0.0, 0.02, (6, 6))
        yield time, GRID, heights


def travelling(noise: float) -> Feed:
    """Maps that travel over still hills by zero to two cells a map, as those of a robot that drives."""
    wide = square(161, 0.1)
    hills = np.asarray(make_ground(wide, "noise", deviation=0.05).heights(0.0))
    rng, row, column = np.random.default_rng(3), 0, 0
    for time in at_rate(10.0, SOON):
        row, column = row + int(rng.integers(0, 3)), column + int(rng.integers(0, 3))
        x, y, _ = wide.origin
        geometry = replace(GRID, origin=(x + 0.1 * column, y + 0.1 * row, 0.0))
        part = hills[row : row + 61, column : column + 61]
        yield time, geometry, part + rng.normal(0.0, noise, part.shape)


MOTIONS: dict[str, dict[str, Any]] = {
    "lift, 5 m/s": {"kind": "lift", "speed": 5.0, "duration": 0.15},
    "lift down, 8 m/s": {"kind": "lift", "speed": -8.0, "duration": 1.0},
    "drop at 2 g": {"kind": "drop", "acceleration": 19.62, "depth": 2.0},
}
# Maps in which there is neither noise nor a jump of still ground.
QUIET: dict[str, Callable[[], Feed]] = {
    **{scene.name: partial(of_scene, scene) for scene in read_scenes() if scene.moves},
    **{
        f"waves, {name}, {rate:g} Hz": partial(of_ground, SEA.heights, SEA_GRID, sorted(stamps_of(rate, name)))
        for name in STAMPS for rate in (20.0, 60.0)
    },
    **{
        f"{name}, {rate:g} Hz": partial(of_motion, rate, **motion)
        for name, motion in MOTIONS.items() for rate in (10.0, 30.0, 240.0)
    },
    **{f"{lost} maps lost": partial(with_a_gap, lost) for lost in (2, 4, 6)},
    "messy patch": of_a_messy_patch,
    "each sample at a speed of its own": lambda: (
        (time, GRID, HILLS + time * np.random.default_rng(5).normal(0.0, 0.1, HILLS.shape)) for time in at_rate(10.0)
    ),
    "an origin that rises": lambda: (
        (time, replace(GRID, origin=(*GRID.origin[:2], min(max(time - 1.5, 0.0), 1.0))), HILLS)
        for time in at_rate(30.0, 5.0, 150)
    ),
    "travelling": partial(travelling, 0.0),
    "closures every half second, of which nothing is known": partial(of_mapper, 8.0, 20.0, closure=0.08, every=0.5),
    "too far apart for a velocity": partial(of_mapper, 30.0, 2.0, noise=0.005),
    "grids that change": lambda: (
        (time, square(side, 0.1), np.random.default_rng(number).normal(0.0, 0.005, (side, side)))
        for number, time in enumerate(at_rate(10.0)) for side in [20 + number % 2]
    ),
}  # fmt: skip


@pytest.mark.parametrize("feed", QUIET.values(), ids=QUIET)
def test_ground_that_moves_gives_no_false_alarm(feed: Callable[[], Feed]) -> None:
    assert check_of(feed()).findings == NO_FINDINGS


@given(
    speed=st.floats(0.0, 3.0), rate=st.floats(5.0, 120.0), turn=st.floats(-1.0, 1.0), heave=st.floats(0.0, 0.5),
    cells=st.integers(0, 3),
)  # fmt: skip
@settings(max_examples=15, deadline=None)
def test_a_carried_platform_gives_no_false_alarm(
    speed: float, rate: float, turn: float, heave: float, cells: int
) -> None:
    """Rough ground that slides, also by whole cells a map, or turns, and heaves the while."""
    rough = 0.05 * np.random.default_rng(2).normal(size=(41, 41))
    grid = GridGeometry(rows=41, columns=41, resolution=0.1)
    for by, yaw in ((speed / rate, 0.0), (0.1 * cells, 0.0), (0.0, turn)):
        feed = (
            (time, replace(grid, origin=(by * number, 0.0, 0.0), yaw=yaw * time), rough + heave * math.sin(2.0 * time))
            for number, time in enumerate(at_rate(rate))
        )
        assert check_of(feed).findings == NO_FINDINGS


@given(
    amplitude=st.floats(0.005, 1.0), number=st.floats(0.1, 4.0), frequency=st.floats(0.2, 16.0),
    rate=st.floats(5.0, 240.0), resolution=st.floats(0.05, 0.5),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_waves_give_no_false_alarm_unless_told_by_too_few_samples_and_maps(
    amplitude: float, number: float, frequency: float, rate: float, resolution: float
) -> None:
    """Eight samples a wavelength are enough, and so are twelve maps a period."""
    if number * resolution > math.pi / 4.0 and frequency / rate > math.pi / 6.0:
        number = math.pi / 4.0 / resolution
    geometry = square(61, resolution)
    ground = make_ground(geometry, "waves", amplitude=amplitude, number=number, frequency=frequency)
    assert check_of(of_ground(ground.heights, geometry, at_rate(rate, most=60))).findings == NO_FINDINGS


def test_noise_is_seen_through_smoothing_on_the_way_and_a_closure_in_a_gap() -> None:
    """A mapper that takes means over 3 x 3 samples, one that drives, and one whose maps are missing meanwhile."""

    def smoothed(heights: NDArray[Any]) -> NDArray[Any]:
        return sum(np.roll(heights, (r, c), (0, 1)) for r in (-1, 0, 1) for c in (-1, 0, 1)) / 9.0

    feed = ((time, grid, smoothed(heights)) for time, grid, heights in of_mapper(SOON, 10.0, noise=0.015))
    assert check_of(feed).findings.noise > 0.0
    assert check_of(travelling(0.005)).findings.noise == pytest.approx(0.005, rel=0.2)
    closure = of_mapper(SOON, 20.0, noise=0.002, closure=0.08)
    gap = (one for one in closure if not 1.9 <= one[0] < 2.05)
    assert check_of(gap).findings.jump == pytest.approx(0.08, rel=0.1)


@given(seed=st.integers(0, 10**6), rows=st.integers(1, 9), columns=st.integers(1, 9))
def test_counts_are_those_of_whole_arrays(seed: int, rows: int, columns: int) -> None:
    """Every sample is a place of the lattice, and three maps with holes are compared."""
    rng = np.random.default_rng(seed)
    maps = rng.normal(0.0, 0.01, (3, rows, columns)).astype(np.float32)
    maps[rng.random(maps.shape) < 0.1] = np.nan
    lattice = CORE.SampleLattice(rows, columns, 9)
    for heights in maps:
        found, step = lattice.compare(heights, 0.0, (0, 0), 0.002)
    first, last = np.diff(maps.astype(np.float64), axis=0)
    both = (np.abs(first) >= 0.002) & (np.abs(last) >= 0.002)
    tilts = np.diff(last, axis=1)
    left, right = tilts[:, :-1], tilts[:, 1:]
    counted = (np.abs(left) >= 0.002) & (np.abs(right) >= 0.002)
    expected = (
        np.isfinite(last).sum(), both.sum(), (both & (first * last < 0.0)).sum(), counted.sum(),
        (counted & (left * right > 0.0)).sum(), np.abs(left[counted]).sum(),
    )  # fmt: skip
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert step == pytest.approx(np.median(np.abs(last[np.isfinite(last)])) if np.isfinite(last).any() else 0.0)
