"""Runs several settings of one case in turns, and measures cost and accuracy of each."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.measures import HELD_UP, penetration
from smartmesh_ros.tools.tune.case import Case, Ground
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.parts import Part, Pose, parts_of, pose_of
from smartmesh_ros.tools.tune.replay import Replay

# Type of Part.key.
Key = tuple[str, int, Vector]


@dataclass(frozen=True, kw_only=True)
class Measuring:
    """How runs are measured.

    ``samples`` [Hz]: rate of measurements; the searched rates are multiples of it. ``pieces``: number of turns within a
    run. ``cost_factor``: a setting is stopped if it costs this many times as much as the first of its run, after at
    least ``grace`` [s] of processor time.
    """

    samples: float = 30.0
    pieces: int = 10
    cost_factor: float = 8.0
    grace: float = 1.0


MEASURING = Measuring()


class Measurements(dict[Key, tuple[float, bool, bool]]):
    """For each part at an instant: clearance [m], centre below the ground (bool), body supported (bool)."""


@dataclass
class Snapshot:
    """Poses of all parts at ``time`` [s]; ``held``: supported bodies; ``positions``: of the bodies [m]."""

    time: float
    poses: list[tuple[Part, Pose]]
    held: set[str]
    positions: dict[str, Vector]


class Runner:
    """One setting in a case: steps its world, times the steps and records snapshots for measurements."""

    def __init__(self, case: Case, settings: Settings) -> None:
        self.note = ""
        self.used = 0.0
        self.steps: list[float] = []  # processor time of each step [s]
        self.snapshots: list[Snapshot] = []
        self.measured: list[Measurements] = []
        self._case = case
        self._rate = settings.world.physics.rate
        self._gravity = settings.world.physics.gravity
        self._fed = -math.inf
        self.replay = Replay(settings, case.bodies())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return len(self.steps) / self._rate

    def advance(self, until: float) -> None:
        """Step to ``until`` [s] and take a snapshot."""
        world, last = self.replay.world, round(until * self._rate)
        before: dict[str, Vector] = {}
        while len(self.steps) < last:
            events = self._case.events(self._fed, world.time)
            self._fed = world.time
            if len(self.steps) == last - 1:
                before = self._velocities()
            start = process_time()
            self.replay.step(events)
            self.steps.append(process_time() - start)
            self.used += self.steps[-1]
        self._take_snapshot(before)

    def _velocities(self) -> dict[str, Vector]:
        world = self.replay.world
        return {
            name: world.client.getBaseVelocity(body.uid)[0] for name, body in world.bodies.items() if not body.tracked
        }

    def _take_snapshot(self, before: Mapping[str, Vector]) -> None:
        world = self.replay.world
        poses = [(part, pose_of(world.client, part)) for part in parts_of(world)]
        weight = HELD_UP * math.hypot(*self._gravity)
        held = set()
        for name, after in self._velocities().items():
            if name in before:
                felt = [(b - a) * self._rate - g for a, b, g in zip(before[name], after, self._gravity, strict=True)]
                held |= {name} if math.hypot(*felt) > weight else set()
        positions = {name: world.state(name).position for name, body in world.bodies.items() if not body.tracked}
        self.snapshots.append(Snapshot(self.time, poses, held, positions))

    def measure(self, grounds: Mapping[float, Sequence[Ground]]) -> None:
        """Measure the snapshots since the last call against the true ground by time [s]."""
        for snapshot in self.snapshots[len(self.measured) :]:
            self.measured.append(_measure_parts(snapshot, grounds[snapshot.time]))

    def figures(self, reference: Mapping[str, Vector] | None, steps: Sequence[float] | None = None) -> Figures:
        """Return all figures; ``steps``: times of the steps [s] instead of the runner's own."""
        times = self.steps if steps is None else steps
        world, case = self.replay.world, self._case
        keys = list(dict.fromkeys(key for seen in self.measured for key in seen))
        cost, ran = (sum(times) / self.time if times else math.nan), self.time
        skip = sum(snapshot.time < case.span.settle for snapshot in self.snapshots)
        if not keys or len(self.measured) <= skip:
            return Figures(cost=cost, ran=ran, note=self.note or "no body was ever over the ground")
        nothing = (math.nan, False, False)
        table = np.array([[seen.get(key, nothing) for key in keys] for seen in self.measured])
        below = np.logical_or.accumulate(table[..., 1] > 0.0, axis=0)
        found = penetration(table[skip:, :, 0], below[skip:], table[skip:, :, 2] > 0.0)
        settled = times[round(case.span.settle * self._rate) :]
        return Figures(
            cost=cost,
            longest=max(settled, default=math.nan),
            penetration=found.p99,
            hover=found.hover,
            deviation=self._deviation(reference),
            lost=len({keys[index][0] for index in np.flatnonzero(below[-1])} | set(world.lost)),
            rescued=world.rescues,
            bodies=len({key[0] for key in keys}),
            ran=ran,
            note=self.note,
        )

    def _deviation(self, reference: Mapping[str, Vector] | None) -> float:
        horizon = self._case.span.horizon
        snapshot = next((snapshot for snapshot in self.snapshots if snapshot.time >= horizon - 0.5 / self._rate), None)
        if reference is None or snapshot is None:
            return math.nan
        apart = [
            math.dist(snapshot.positions[name], reference[name]) for name in reference if name in snapshot.positions
        ]
        return float(np.median(apart)) if apart else math.nan


def run(
    case: Case,
    settings: Sequence[Settings],
    duration: float,
    reference: Mapping[str, Vector] | None,
    *,
    repeats: int = 1,
    say: Callable[[str], None] = lambda _: None,
) -> list[Figures]:
    """Run the settings for ``duration`` [s] of simulated time in turns, and return their figures.

    A setting that costs `Measuring.cost_factor` times as much as the first one is stopped. The time of every step is
    the median over ``repeats``, so that other load on the machine has little influence.
    """
    times: list[list[list[float]]] = [[] for _ in settings]
    found: list[Runner] = []
    for repeat in range(repeats):
        runners = _once(case, settings, duration, measured=repeat == 0, say=say)
        for index, runner in enumerate(runners):
            times[index].append(runner.steps)
        found = found or runners
        for runner in runners:
            runner.replay.close()
    return [runner.figures(reference, _middle(steps)) for runner, steps in zip(found, times, strict=True)]


def _middle(repeats: Sequence[Sequence[float]]) -> list[float]:
    """Return the median time of each step."""
    count = min(map(len, repeats))
    middle: list[float] = np.median(np.array([steps[:count] for steps in repeats]), axis=0).tolist()
    return middle


def _once(
    case: Case, settings: Sequence[Settings], duration: float, *, measured: bool, say: Callable[[str], None]
) -> list[Runner]:
    case.fresh()
    runners = [Runner(case, chosen) for chosen in settings]
    instants = np.arange(1, math.floor(duration * MEASURING.samples + 1e-6) + 1) / MEASURING.samples
    pieces = np.array_split(instants, min(MEASURING.pieces, max(len(instants), 1)))
    for part, piece in enumerate(pieces):
        turn = part % len(runners)
        for index, runner in enumerate(runners[turn:] + runners[:turn]):
            say(f"{part + 1}/{len(pieces)} {index + 1}/{len(runners)}")
            if runner.note:
                continue
            with _without_collector():
                for instant in piece.tolist():
                    runner.advance(instant)
            _stop_if_too_slow(runner, runners[0])
        if measured:
            fresh = {snapshot.time for runner in runners for snapshot in runner.snapshots[len(runner.measured) :]}
            grounds = {time: case.truth(time) for time in sorted(fresh)}
            for runner in runners:
                runner.measure(grounds)
        case.forget(float(piece[-1]) if len(piece) else 0.0)
    return runners


def _stop_if_too_slow(runner: Runner, first: Runner) -> None:
    """Stop a setting that costs far more than the first one."""
    if runner is first or runner.used < MEASURING.grace or not first.steps:
        return
    if runner.used / runner.time > MEASURING.cost_factor * first.used / first.time:
        runner.note = f"stopped after {runner.time:.2f} s: it costs too much"


@contextmanager
def _without_collector() -> Iterator[None]:
    """Disable Python's garbage collector, because its pauses are not caused by the step in which they occur."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _measure_parts(snapshot: Snapshot, grounds: Sequence[Ground]) -> Measurements:
    """Measure all parts of a snapshot."""
    found = Measurements()
    shapes: dict[Shape, list[tuple[Part, Pose]]] = {}
    for part, pose in snapshot.poses:
        shapes.setdefault(part.shape, []).append((part, pose))
    for shape, members in shapes.items():
        clearance, below = _over(grounds, shape, [pose for _, pose in members])
        for (part, _), gap, under in zip(members, clearance.tolist(), below.tolist(), strict=True):
            found[part.key] = (gap, under, part.free and part.body in snapshot.held)
    return found


def _over(grounds: Sequence[Ground], shape: Shape, poses: Sequence[Pose]) -> tuple[FloatArray, Any]:
    """Return the clearance (N,) [m] of bodies from the nearest tile at their x and y, NaN = none, and a mask (N,) of
    bodies whose centre is below the ground."""
    clearance = np.full(len(poses), np.nan)
    below = np.zeros(len(poses), bool)
    for ground in grounds:
        placed = [_in_tile_frame(pose, ground) for pose in poses]
        positions = np.array([pose.position for pose in placed])
        heights = ground.surface.below(positions)
        over = np.flatnonzero(np.isfinite(heights))
        if len(over):
            orientations = np.array([placed[index].orientation for index in over])
            gaps = clearances(ground.surface, shape, positions[over], orientations)
            clearance[over] = np.fmin(clearance[over], gaps)
            below[over] |= positions[over, 2] < heights[over]
    return clearance, below


def _in_tile_frame(pose: Pose, ground: Ground) -> Pose:
    """Return a pose in the frame of a tile that is rotated about z around its origin."""
    if not ground.yaw:
        return pose
    x0, y0, _ = ground.surface.geometry.origin
    cos, sin = math.cos(ground.yaw), math.sin(ground.yaw)
    x, y, z = pose.position[0] - x0, pose.position[1] - y0, pose.position[2]
    half = (0.0, 0.0, math.sin(-0.5 * ground.yaw), math.cos(0.5 * ground.yaw))
    return Pose((x0 + x * cos + y * sin, y0 - x * sin + y * cos, z), product(half, pose.orientation))


def require_measurable(figures: Figures) -> None:
    """Raise `InputError` if the figures cannot be used to compare settings."""
    if figures.note or math.isnan(figures.penetration):
        raise InputError(
            "bodies",
            f"nothing can be measured here: {figures.note or 'no body was ever over the ground'}; the parameter "
            "file's bodies.spawn or robot.description must put bodies over the maps",
        )
