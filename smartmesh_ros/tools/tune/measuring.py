"""Runs several settings of one case in turns, and measures cost and accuracy of each."""

from __future__ import annotations

import gc
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.measures import HELD_UP, penetration
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.replay import Replay
from smartmesh_ros.world.world import World

# Shapes from PyBullet's sizes. The surface of a mesh is not measured.
_SHAPES: Mapping[int, Callable[[Sequence[float]], Shape]] = {
    pb.GEOM_SPHERE: lambda size: Sphere(size[0]),
    pb.GEOM_BOX: lambda size: Box(*size),
    pb.GEOM_CYLINDER: lambda size: Cylinder(height=size[0], radius=size[1]),
    pb.GEOM_CAPSULE: lambda size: Capsule(height=size[0], radius=size[1]),
}


class Part(NamedTuple):
    """A measured shape of a body: that of the whole body (``link`` -1, ``number`` 0), or one of a robot's link."""

    body: str
    link: int
    number: int
    shape: Shape


# Position [m] and orientation of a part.
Pose = tuple[Vector, Quaternion]


@dataclass(frozen=True, kw_only=True)
class Measuring:
    """``samples`` [Hz]: rate of measurements; the searched rates are multiples of it. ``pieces``: number of turns
    within a run. ``cost_factor``: a setting is stopped if it costs this many times as much as the first of its run,
    after at least ``grace`` [s] of processor time."""

    samples: float = 30.0
    pieces: int = 10
    cost_factor: float = 8.0
    grace: float = 1.0


MEASURING = Measuring()


@dataclass
class Snapshot:
    """Poses of all parts at ``time`` [s]; ``held``: supported bodies without joints, which only the ground supports;
    ``positions``: of the bodies [m]; ``measured``: for each part its clearance [m], whether its centre is below the
    ground, and whether its body is supported."""

    time: float
    poses: dict[Part, Pose]
    held: set[str]
    positions: dict[str, Vector]
    measured: dict[Part, tuple[float, bool, bool]] = field(default_factory=dict)


class Runner(Replay):
    """The replay of one setting in a case: steps its world, times the steps [s] and records snapshots."""

    def __init__(self, case: Case, settings: Settings) -> None:
        super().__init__(settings, case.bodies, case.events())
        self.stopped = False
        self.steps: list[float] = []
        self.snapshots: list[Snapshot] = []
        self.rate = settings.world.physics.rate
        self._gravity = settings.world.physics.gravity

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return len(self.steps) / self.rate

    @property
    def cost(self) -> float:
        """Processor time per simulated second [s]."""
        return sum(self.steps) / self.time if self.steps else math.nan

    def advance(self, until: float) -> None:
        """Step to ``until`` [s] and take a snapshot."""
        last, before = round(until * self.rate), dict[str, Vector]()
        while len(self.steps) < last:
            events = self.due()
            if len(self.steps) == last - 1:
                before = self._velocities()
            start = process_time()
            self.step(events)
            self.steps.append(process_time() - start)
        self._take_snapshot(before)

    def _velocities(self) -> dict[str, Vector]:
        bodies = [body for body in self.world.bodies.values() if not body.tracked]
        return {body.name: self.world.client.getBaseVelocity(body.uid)[0] for body in bodies}

    def _take_snapshot(self, before: Mapping[str, Vector]) -> None:
        world, after = self.world, self._velocities()
        held = set()
        for name in before.keys() & after.keys():
            felt = (np.array(after[name]) - before[name]) * self.rate - self._gravity
            if world.bodies[name].shape is not None and np.linalg.norm(felt) > HELD_UP * math.hypot(*self._gravity):
                held.add(name)
        positions = {name: world.state(name).position for name in after}
        self.snapshots.append(Snapshot(self.time, dict(_parts_of(world)), held, positions))


def _parts_of(world: World) -> Iterator[tuple[Part, Pose]]:
    """Yield the parts of simulated bodies that are spheres, boxes, cylinders or capsules, and their poses."""
    client: Any = world.client
    for body in (body for body in world.bodies.values() if not body.tracked):
        base = client.getBasePositionAndOrientation(body.uid)
        if body.shape is not None:
            yield Part(body.name, -1, 0, body.shape), base
            continue
        for link in body.links:
            pose = base if link < 0 else client.getLinkState(body.uid, link, computeForwardKinematics=1)[:2]
            for number, (_, _, kind, size, _, *offset) in enumerate(client.getCollisionShapeData(body.uid, link)):
                if kind in _SHAPES:
                    with suppress(InputError):  # outside the range of sizes that is measured
                        yield Part(body.name, link, number, _SHAPES[kind](size)), pb.multiplyTransforms(*pose, *offset)


def run(case: Case, settings: Sequence[Settings], duration: float, repeats: int = 1) -> list[Runner]:
    """Run the settings for ``duration`` [s] of simulated time in turns, those that cost too much for less. The time of
    every step is the median over ``repeats``, so that other load on the machine has little influence."""
    rounds = [_once(case, settings, duration) for _ in range(repeats)]
    for index, runner in enumerate(rounds[0]):
        count = min(len(runners[index].steps) for runners in rounds)
        runner.steps = np.median([runners[index].steps[:count] for runners in rounds], axis=0).tolist()
    return rounds[0]


def _once(case: Case, settings: Sequence[Settings], duration: float) -> list[Runner]:
    runners = [Runner(case, chosen) for chosen in settings]
    instants = np.arange(1, math.floor(duration * MEASURING.samples + 1e-6) + 1) / MEASURING.samples
    for part, piece in enumerate(np.array_split(instants, MEASURING.pieces)):
        turn = part % len(runners)
        for runner in runners[turn:] + runners[:turn]:
            gc.disable()  # its pauses are not caused by the step in which they occur
            for instant in piece.tolist():
                if not runner.stopped:
                    runner.advance(instant)
                    too_slow = runner.cost > MEASURING.cost_factor * runners[0].cost
                    runner.stopped = too_slow and sum(runner.steps) > MEASURING.grace
            gc.enable()
    for runner in runners:
        runner.world.close()
    return runners


def measure(case: Case, runners: Sequence[Runner], reference: Mapping[str, Vector] | None) -> list[Figures]:
    """Return the figures of runs; ``reference``: positions of bodies at the span's horizon [m], None = unknown."""
    truth = case.truth()
    snapshots = sorted((taken for runner in runners for taken in runner.snapshots), key=lambda taken: taken.time)
    for time, together in groupby(snapshots, key=lambda taken: taken.time):
        surfaces = truth(time).values()
        for snapshot in together:
            snapshot.measured = _measure_parts(snapshot, surfaces)
    return [_figures(case, runner, reference or {}) for runner in runners]


def _figures(case: Case, runner: Runner, reference: Mapping[str, Vector]) -> Figures:
    """Return the figures of a run whose snapshots are measured; of a stopped one the cost alone."""
    measured = [snapshot.measured for snapshot in runner.snapshots]
    parts = list(dict.fromkeys(part for seen in measured for part in seen))
    skip = sum(snapshot.time < case.span.settle for snapshot in runner.snapshots)
    if runner.stopped or not parts or len(measured) <= skip:
        return Figures(cost=runner.cost)
    nothing = (math.nan, False, False)
    table = np.array([[seen.get(part, nothing) for part in parts] for seen in measured])
    below = np.logical_or.accumulate(table[..., 1] > 0.0, axis=0)
    found = penetration(table[skip:, :, 0], below[skip:], table[skip:, :, 2] > 0.0)
    world = runner.world
    return Figures(
        cost=runner.cost,
        longest=max(runner.steps[round(case.span.settle * runner.rate) :], default=math.nan),
        penetration=found.p99,
        hover=found.hover,
        deviation=_deviation(runner, case.span.horizon, reference),
        lost=len({parts[index].body for index in np.flatnonzero(below[-1])} | set(world.lost)),
        rescued=world.rescues,
    )


def _deviation(runner: Runner, horizon: float, reference: Mapping[str, Vector]) -> float:
    """Return the median distance of the bodies from the reference at ``horizon`` [s]; NaN = unknown [m]."""
    reached = (snapshot for snapshot in runner.snapshots if snapshot.time >= horizon - 0.5 / runner.rate)
    positions = next((snapshot.positions for snapshot in reached), {})
    apart = [math.dist(positions[name], place) for name, place in reference.items() if name in positions]
    return float(np.median(apart)) if apart else math.nan


def _measure_parts(snapshot: Snapshot, surfaces: Iterable[Surface]) -> dict[Part, tuple[float, bool, bool]]:
    """Measure all parts of a snapshot against the nearest tile at their x and y."""
    shapes: dict[Shape, list[Part]] = defaultdict(list)
    for part in snapshot.poses:
        shapes[part.shape].append(part)
    found = {}
    for shape, parts in shapes.items():
        positions, orientations = (np.array(column) for column in zip(*map(snapshot.poses.get, parts), strict=True))
        clearance, below = np.full(len(parts), np.nan), np.zeros(len(parts), bool)
        for surface in surfaces:
            heights = surface.below(positions)
            over = np.flatnonzero(np.isfinite(heights))
            if len(over):
                gaps = clearances(surface, shape, positions[over], orientations[over])
                clearance[over] = np.fmin(clearance[over], gaps)
                below[over] |= positions[over, 2] < heights[over]
        for part, gap, under in zip(parts, clearance.tolist(), below.tolist(), strict=True):
            found[part] = gap, under, part.body in snapshot.held
    return found
