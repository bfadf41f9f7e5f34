"""Rows on maps as sensors and mappers make them: corrections and noise under bodies at rest; noise and uneven stamps on
moving ground."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from smartmesh_ros import BodyState, Box, Cylinder, JointCommand, MotionConfig, Sphere
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from studies.matrix.arena import HUSKY, Arena, Method, own_row
from studies.matrix.moving_ground import WAVES
from studies.robots.robot import LAIKAGO

CELLS, RESOLUTION = 61, 0.1
STEP = 1.0 / 240.0
NOISE_RATE = 20.0  # of noisy maps [Hz]
SHAPES: dict[str, Shape] = {
    "box": Box(0.4, 0.4, 0.3),
    "ball": Sphere(0.15),
    "cylinder": Cylinder(radius=0.2, height=0.3),
}
ROBOTS = {"wheeled robot": (HUSKY, 0.0), "robot on legs": (LAIKAGO.urdf, 0.46)}  # and how high they start [m]
SIZES = (0.01, 0.03, 0.1, 0.3, -0.01, -0.03, -0.1, -0.3)
ISSUE = "a correction gives no speed"
CORRECTIONS = MotionConfig(changes="correction")


class Site(Arena):
    """One body at rest on ground of a slope [rad] along x. ``motion``: how maps are processed. Use it as a context
    manager."""

    def __init__(self, method: Method, kind: str, slope: float = 0.0, motion: MotionConfig = CORRECTIONS) -> None:
        self.level = inclined(slope)
        super().__init__(method, self.level, size=CELLS, resolution=RESOLUTION, motion=motion)
        away = ROBOTS[kind][1] if kind in ROBOTS else 0.15
        state = BodyState(
            (-math.sin(slope) * away, 0.017, math.cos(slope) * away),
            (0.0, -math.sin(0.5 * slope), 0.0, math.cos(0.5 * slope)),
        )
        if kind in ROBOTS:
            self.world.spawn_robot("body", ROBOTS[kind][0], state)
            for joint in self.world.bodies["body"].joints:
                hold = JointCommand(position=0.0) if kind == "robot on legs" else JointCommand(velocity=0.0)
                self.world.command("body", joint, hold)
        else:
            self.world.spawn("body", SHAPES[kind], 20.0, state)

    @property
    def state(self) -> BodyState:
        """How the body is."""
        return self.world.state("body")

    def states(self, seconds: float) -> list[BodyState]:
        """Steps through so many seconds; returns how the body was after every step."""
        return [self.state for _ in self.run(seconds)]

    def in_noise(self, noise: float, seconds: float) -> list[BodyState]:
        """Return how the body is after every step of a time [s] with level maps at 20 Hz that have white noise [m]."""
        rng, states = np.random.default_rng(2), []
        for _ in range(round(seconds * NOISE_RATE)):
            self.tell(rng.normal(0.0, noise, (CELLS, CELLS)))
            states += self.states(1.0 / NOISE_RATE)
        return states


def inclined(slope: float) -> FloatArray:
    """Ground that rises along x."""
    axis = (np.arange(CELLS) - CELLS // 2) * RESOLUTION
    return np.tile(math.tan(slope) * axis, (CELLS, 1))


def correction(
    method: Method, kind: str, by: float, after: float, slope: float = 0.0, turn: float = 0.0
) -> dict[str, float]:
    """A body at rest whose ground is corrected by a height [m] and a turn [rad], a time after the last map [s]: how far
    it rises above its new rest [mm], its maximum speed [m/s], rotation relative to the ground [deg] and sliding
    [mm]."""
    with Site(method, kind, slope) as site:
        site.settle(2.0)
        site.tell(site.level)
        site.settle(after)
        before = site.state
        site.tell(inclined(slope + turn) + by)
        states = site.states(2.0)
        end = states[-1]
        rest = max(before.position[2], end.position[2])
        up, now_up = rotated(np.array([before.orientation, end.orientation]), np.array([0.0, 0.0, 1.0]))
        turned = math.acos(min(float(up @ now_up), 1.0)) - abs(turn)
        slid = math.dist(before.position[:2], end.position[:2])
        return {
            "above": 1e3 * (max(state.position[2] for state in states) - rest),
            "speed": max(math.hypot(*state.linear) for state in states),
            "turned": math.degrees(abs(turned)),
            "slid": 1e3 * slid,
        }


def worst_correction(measure: str, kind: str, slope: float, turn: float, method: Method) -> float:
    """The worst figure of a body over all corrections; infinite where it does not keep its tilt to a degree."""
    cases = [(by, after) for by in SIZES for after in (0.1, 1.0)] if not slope and not turn else [(0.1, 0.1)]
    found = [correction(method, kind, by, after, slope, turn) for by, after in cases]
    return math.inf if max(one["turned"] for one in found) > 1.0 else max(one[measure] for one in found)


def at_rest_in_noise(measure: str, kind: str, sigma: float, method: Method) -> float:
    """Return a figure of a body on level ground whose maps have white noise, at 20 Hz, for 10 s after the first map:
    its maximum speed [m/s], largest error of height in standard deviations, or drift [mm]."""
    with Site(method, kind, motion=replace(CORRECTIONS, noise=sigma)) as site:
        rest = site.state.position[2]
        states = site.in_noise(sigma, 11.0)[round(1.0 / STEP) :]
        drift = 1e3 * max(math.dist(states[0].position[:2], state.position[:2]) for state in states)
        speed = max(math.hypot(*state.linear) for state in states)
        height = max(abs(state.position[2] - rest) / sigma for state in states)
        return {"speed": speed, "height": height, "drift": drift}[measure]


KINDS = (*SHAPES, *ROBOTS)
RESTING_ROWS = (
    *(
        own_row(
            f"corrected by 1 to 30 cm, {kind}: {measure}", partial(worst_correction, measure, kind, 0.0, 0.0), limit,
            unit, ISSUE, quick=kind == "box",
        )
        for kind in KINDS
        for measure, limit, unit in (("above", 5.0, "mm"), ("speed", 0.2, "m/s"))
    ),
    *(
        own_row(f"{what}, {kind}: {measure}", partial(worst_correction, measure, kind, slope, turn), limit, unit, why)
        for what, measure, slope, turn, limit, unit, why in (
            ("corrected by 10 cm on 15 deg", "slid", math.radians(15.0), 0.0, 5.0, "mm", "friction holds"),
            ("map tilted by 2 deg", "speed", 0.0, math.radians(2.0), 0.2, "m/s", ISSUE),
        )
        for kind in ("box", "cylinder", "wheeled robot")
    ),
    *(
        own_row(
            f"noise of {1e3 * sigma:g} mm, {kind}: {measure}", partial(at_rest_in_noise, measure, kind, sigma), limit,
            unit, "stays on the ground" if kind == "ball" else "stands still",
        )
        for kind in ("box", "wheeled robot", "ball")
        for sigma in (0.005, 0.01)
        for measure, limit, unit in (("speed", 0.05, "m/s"), ("height", 2.0, "sigma"), ("drift", 20.0, "mm"))
        if kind != "ball" or measure == "height"
    ),
)  # fmt: skip


BODIES: dict[str, Shape] = {"balls": Sphere(0.2), "boxes": Box(0.4, 0.4, 0.3)}
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
MOVING_ROWS = (
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
ROWS = (*RESTING_ROWS, *MOVING_ROWS)
