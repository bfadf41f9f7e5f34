"""Runs one setting of a case, and measures its cost and accuracy."""

from __future__ import annotations

import gc
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import CENTRED, SHAPES, Shape, shape_of
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.measures import held_up, penetration
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.world.world import World

# Kinds of shapes by PyBullet's, whose sizes have the same order. The surface of a mesh is not measured.
_KINDS = {shape.geometry: kind for kind, shape in SHAPES.items()}
# Rate of measurements [Hz], of which all rates of the grid are multiples.
SAMPLES = 30.0
# Time at which bodies are compared with a run at small steps [s]; later, contacts make motion chaotic.
HORIZON = 1.0
# Number of runs. They are the same but for the time that each step takes, of which the median counts.
REPEATS = 3


class Part(NamedTuple):
    """A measured shape of a body: that of the whole body (``link`` -1, ``number`` 0), or one of a robot's link."""

    body: str
    link: int
    number: int
    shape: Shape


# Position [m] and orientation of a part.
Pose = tuple[Vector, Quaternion]


class Snapshot(NamedTuple):
    """Poses of all parts at ``time`` [s]; ``held``: supported bodies without joints, which only the ground supports."""

    time: float
    poses: dict[Part, Pose]
    held: set[str]


def measure(case: Case, values: Mapping[str, Any]) -> tuple[Figures, dict[str, Vector]]:
    """Return the figures of a case with these parameters but for the deviation, and the positions of bodies at the
    horizon [m]. Raises `InputError` if the node would refuse the parameters."""
    first, figures, positions = _run(case, values)
    steps = np.median([first, *(_run(case, values, accuracy=False)[0] for _ in range(REPEATS - 1))], axis=0)
    after = steps[round(case.settle * len(steps) / case.length) :]
    cost = float(steps.sum()) / case.length
    return replace(figures, cost=cost, longest=float(after.max(initial=0.0))), positions


def _run(
    case: Case, values: Mapping[str, Any], *, accuracy: bool = True
) -> tuple[list[float], Figures, dict[str, Vector]]:
    """Return the processor time of each step with the messages before it [s], the figures of ``accuracy``, which are
    those of any other run, and the positions of bodies at the horizon [m]."""
    replay, truth = case.start(values)
    with replay:
        world, rate = replay.world, replay.collider.settings.world.physics.rate
        spent, before, positions = 0.0, dict[str, Vector](), dict[str, Vector]()
        times, snapshots, steps = list[float](), list[Snapshot](), replay.steps(case.length)
        gc.disable()  # its pauses are not caused by the step in which they occur
        while True:
            start, at = process_time(), world.time
            ended = next(steps, steps) is steps
            spent += process_time() - start
            if ended:
                break
            number, steps_of_sample = round(world.time * rate), max(round(rate / SAMPLES), 1)
            measured = world.time != at and number % steps_of_sample == 0
            truth.note(world, measured=measured)
            if world.time == at:
                continue
            times.append(spent)
            spent = 0.0
            if measured:
                snapshots.append(Snapshot(world.time, dict(_parts_of(world)), _held(world, before, rate)))
            if (number + 1) % steps_of_sample == 0:
                before = _velocities(world)
            if number == round(min(HORIZON, case.length) * rate):
                positions = {name: world.state(name).position for name in _velocities(world)}
        gc.enable()
        lost, rescued = set(world.lost), world.rescues
    surfaces = (truth.at(snapshot.time) for snapshot in snapshots)
    figures = _accuracy(case, snapshots, surfaces, lost) if accuracy else Figures()
    return times, replace(figures, failed=figures.failed + rescued), positions


def _velocities(world: World) -> dict[str, Vector]:
    bodies = [body for body in world.bodies.values() if body.simulated]
    return {body.name: world.client.getBaseVelocity(body.uid)[0] for body in bodies}


def _held(world: World, before: Mapping[str, Vector], rate: float) -> set[str]:
    """Return the bodies without joints that something supports in the last step."""
    after = _velocities(world)
    names = [name for name in before.keys() & after.keys() if world.bodies[name].shape is not None]
    now, then = (np.array([of[name] for name in names]).reshape(-1, 3) for of in (after, before))
    return {names[index] for index in np.flatnonzero(held_up(then, now, 1.0 / rate, world.config.physics.gravity))}


def _parts_of(world: World) -> Iterator[tuple[Part, Pose]]:
    """Yield the parts of simulated bodies that are spheres, boxes, cylinders or capsules, and their poses."""
    client: Any = world.client
    for body in (body for body in world.bodies.values() if body.simulated):
        base = client.getBasePositionAndOrientation(body.uid)
        if body.shape is not None:
            yield Part(body.name, -1, 0, body.outline), base
            continue
        for link in body.links:
            pose = base if link < 0 else client.getLinkState(body.uid, link, computeForwardKinematics=1)[:2]
            for number, (_, _, kind, size, _, *offset) in enumerate(client.getCollisionShapeData(body.uid, link)):
                if kind in _KINDS:
                    with suppress(InputError):  # outside the range of sizes that is measured
                        shape = shape_of(_KINDS[kind], size, CENTRED)
                        yield Part(body.name, link, number, shape), pb.multiplyTransforms(*pose, *offset)


def _accuracy(
    case: Case, snapshots: Sequence[Snapshot], surfaces: Iterable[Sequence[Surface]], lost: set[str]
) -> Figures:
    measured = [_measure_parts(snapshot, ground) for snapshot, ground in zip(snapshots, surfaces, strict=True)]
    parts = list(dict.fromkeys(part for seen in measured for part in seen))
    skip = sum(snapshot.time < case.settle for snapshot in snapshots)
    if not parts or len(measured) <= skip:
        return Figures()
    nothing = (math.nan, False, False)
    table = np.array([[seen.get(part, nothing) for part in parts] for seen in measured])
    below = np.logical_or.accumulate(table[..., 1] > 0.0, axis=0)
    found = penetration(table[skip:, :, 0], below[skip:], table[skip:, :, 2] > 0.0)
    under = {parts[index].body for index in np.flatnonzero(below[-1])}
    return Figures(penetration=found.p99, hover=found.hover, failed=len(under | lost))


def _measure_parts(snapshot: Snapshot, surfaces: Iterable[Surface]) -> dict[Part, tuple[float, bool, bool]]:
    """Return for each part its clearance from the nearest tile at its x and y [m], whether its centre is below the
    ground, and whether its body is supported."""
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
