"""Rows on moving ground with maps of sensors: noisy heights and uneven stamps."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from smartmesh_ros import Box, MotionConfig, Sphere
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import IntArray
from studies.matrix.arena import Arena, Method, own_row
from studies.matrix.moving_ground import WAVES

BODIES: dict[str, Shape] = {"balls": Sphere(0.2), "boxes": Box(0.4, 0.4, 0.3)}
STEP = 1.0 / 240.0
# What is not measured at first, and how long a run takes [s].
SETTLE, DURATION = 1.0, 5.0


# Of the waves, kind of the bodies, stamps of the maps [s], their noise [m] and its seed.
Run = tuple[int, str, tuple[float, ...], float, int]


@cache
def ride(
    frequency: int, kind: str, stamps: tuple[float, ...], noise: float, seed: int, method: Method
) -> tuple[float, float]:
    """Return the motion of sixteen bodies on waves, with maps at ``stamps`` [s] and white ``noise`` [m]: penetration,
    99 % [mm], and the maximum height of any centre above the troughs, as a share of the waves' height from trough to
    crest [%]."""
    rng, due, depths, highest = np.random.default_rng(seed), list(stamps), [], 0.0
    shape, waves = BODIES[kind], WAVES[frequency]
    with Arena(method, waves) as arena:
        arena.heightmap.motion = MotionConfig(noise=noise)
        arena.scatter(16, shape, 4.0, shape.bounding_radius + 0.05)
        rest = shape.radius if isinstance(shape, Sphere) else 0.15
        for _ in range(round(DURATION / STEP)):
            while due and due[0] <= arena.world.time + 1e-9:
                stamp = due.pop(0)
                heights = np.asarray(arena.ground.heights(stamp), np.float64)
                arena.heightmap.replace(heights + rng.normal(0.0, noise, heights.shape), time=stamp)
            arena.world.step()
            if arena.world.time > SETTLE:
                depths.append(-arena.clearances())
                highest = max(highest, float(arena.positions()[:, 2].max()) - rest)
    most = waves["amplitude"]
    return (max(1e3 * float(np.nanpercentile(depths, 99.0)), 0.0), 100.0 * (highest + most) / (2.0 * most))


# By name, and of the numbers of maps (M,): the instants at which they come, in intervals.
STAMPS: dict[str, Callable[[IntArray], Any]] = {
    "jitter of an interval": lambda n: n + np.random.default_rng(4).uniform(0.0, 1.0, len(n)),
    "bursts of five": lambda n: n // 5 * 5 + 0.2 * (n % 5),
    "every third dropped": lambda n: n[n % 3 != 2],
    "two swapped": lambda n: n[n % 10 != 8],  # the older one was overtaken, and is left out
}


def stamps_of(rate: float, name: str = "") -> tuple[float, ...]:
    """Return the stamps [s] of maps at a rate [Hz], even ones or those of `STAMPS`."""
    numbers = np.arange(math.ceil(DURATION * rate))
    return tuple(((STAMPS[name](numbers) if name else numbers) / rate).tolist())


def deeper(unit: float, run: Run, exact: Run, method: Method) -> float:
    """How much deeper bodies are in the ground than in an ``exact`` run, 99 % [``unit`` mm]."""
    return (ride(*run, method)[0] - ride(*exact, method)[0]) / unit


def risen(run: Run, exact: Run | None, method: Method) -> float:
    """How far the highest body rises, of what it does in an ``exact`` run, None = of what the waves do [%]."""
    found = ride(*run, method)[1]
    return found if exact is None else 100.0 * found / ride(*exact, method)[1]


# Stamps, rate of the maps [Hz], and how much more seldom the even ones are that they are compared with: nobody knows
# how ground goes on that is not told for several intervals.
RUNS = (
    *((name, 60.0, 5.0 if name == "bursts of five" else 1.0) for name in STAMPS),
    *((name, 20.0, 2.0) for name in STAMPS if name != "bursts of five"),
)
ROWS = (
    *(
        own_row(
            f"noise of {1e3 * noise:g} mm on waves w = {frequency} at {rate:g} Hz, {kind}: {measure}",
            figure, limit, unit, source,
        )
        for frequency in (1, 4)
        for noise in (0.002, 0.005)
        for rate in (20.0, 60.0)
        for kind in BODIES
        for run, exact in [((frequency, kind, stamps_of(rate), noise, 3), (frequency, kind, stamps_of(rate), 0.0, 0))]
        for measure, figure, limit, unit, source in (
            ("deeper", partial(deeper, 1e3 * noise, run, exact), 2.0, "sigma", "as without noise"),
            ("rise", partial(risen, run, None), 120.0, "%", "what the waves do, and a fifth"),
        )
    ),
    *(
        own_row(
            f"{name}, waves w = 4 at {rate:g} Hz: {measure}", figure, limit, unit,
            "as with even stamps" if slower == 1.0 else "as with even stamps as seldom as the longest gaps",
        )
        for name, rate, slower in RUNS
        for run, exact in [
            ((4, "balls", stamps_of(rate, name), 0.0, 0), (4, "balls", stamps_of(rate / slower), 0.0, 0))
        ]
        for measure, figure, limit, unit in (
            ("deeper", partial(deeper, 1.0, run, exact), 1.0, "mm"), ("rise", partial(risen, run, exact), 120.0, "%"),
        )
    ),
)  # fmt: skip
