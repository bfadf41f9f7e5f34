"""Terrain tax: processor time of a step on a map, over that of the same bodies on a plane; of `World`, and of
engines."""

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from time import process_time, thread_time
from timeit import Timer
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros import BodyState, Box, HeightMap, PhysicsConfig, Sphere, World, WorldConfig
from studies.engines.engine import EngineBody, Setup
from studies.pages import number, table
from studies.records.entrants import RATE, enter, entrants
from studies.robots.robot import HUSKY

# How often each cost is measured, in turns: in `World`, and in the engines.
WORLD_ROUNDS, ENGINE_ROUNDS = 25, 9
MAP_RATE = 60  # [Hz]
EVERY = RATE // MAP_RATE  # steps from map to map
SIDE, CELL = 121, 0.25  # samples and resolution [m] of the map
EDGE = 0.5 * CELL * (SIDE - 1)  # from the middle of the map [m]
SPACING = {"ball": 1.2, "box": 1.2, "husky": 3.0}  # between bodies [m]
BALL, BOX = Sphere(0.2), Box(0.4, 0.3, 0.2)
SHAPES: dict[str, tuple[Any, float]] = {"ball": (BALL, BALL.radius), "box": (BOX, 0.5 * BOX.z)}  # and half heights [m]
RISE, RISE_RATE = 0.05, 2.0  # of the moving ground: amplitude [m], angular frequency [rad/s]
# Of `World`: time of one measurement [s], and how long bodies settle before [steps].
BLOCK, SETTLE = 0.03, 240
# Of engines: steps of a measurement, and those before it; bodies that drive move at this velocity along no axis of the
# map [m/s], and nothing slows them down.
MEASURED, BEFORE = 240, 24
DRIVING = np.array([0.8, 0.6])
CASES = ("still", "driving", "moving")


@dataclass(frozen=True)
class Crowd:
    """Bodies of one kind, or robots."""

    kind: str
    count: int

    def places(self) -> list[tuple[float, float]]:
        """Return where its members stand, in a square around the origin [m]."""
        side, spacing = int(np.ceil(np.sqrt(self.count))), SPACING[self.kind]
        middle = 0.5 * (side - 1)
        at = [(k // side - middle, k % side - middle) for k in range(self.count)]
        return [(spacing * x + 0.03, spacing * y + 0.03) for x, y in at]


CROWDS = {
    "1 ball": Crowd("ball", 1), "1 box": Crowd("box", 1), "1 husky": Crowd("husky", 1),
    "100 balls": Crowd("ball", 100), "100 boxes": Crowd("box", 100), "8 huskies": Crowd("husky", 8),
}  # fmt: skip


def waves_at(time: float) -> Any:
    """Return the heights [m] of ground that heaves and tilts."""
    return RISE * np.sin(RISE_RATE * time + np.tile(np.linspace(-1.0, 1.0, SIDE), (SIDE, 1)))


def world_with(crowd: Crowd, ground: HeightMap | None) -> World:
    """Return a world in which a crowd stands in a square. No body may sleep, since sleep costs nothing anywhere."""
    world = World(ground, WorldConfig(physics=PhysicsConfig(rate=RATE, sleep=False)))
    if ground is None:
        plane = world.client.createMultiBody(0.0, world.client.createCollisionShape(pb.GEOM_PLANE))
        world.client.changeDynamics(plane, -1, lateralFriction=1.0)
    for k, (x, y) in enumerate(crowd.places()):
        if crowd.kind == "husky":
            world.spawn_robot(f"husky_{k}", HUSKY.urdf, BodyState((x, y, HUSKY.height + 0.15)))
        else:
            shape, half = SHAPES[crowd.kind]
            world.spawn(f"body_{k}", shape, 1.0, BodyState((x, y, half)))
    return world


def moving_step(world: World, ground: HeightMap) -> Callable[[], None]:
    """Return a step on ground that a map moves every few steps; its intake counts."""
    period, steps = round(2.0 * np.pi / RISE_RATE * MAP_RATE), 0
    maps = [waves_at(k / MAP_RATE).astype(np.float32) for k in range(period)]

    def step() -> None:
        nonlocal steps
        if steps % EVERY == 0:
            ground.replace(maps[steps // EVERY % period], time=world.time)
        steps += 1
        world.step()

    return step


def time_of(step: Callable[[], None], steps: int) -> float:
    """Return the processor time of a step [us]."""
    return Timer(step, timer=thread_time).timeit(steps) / steps * 1e6


def world_times(crowd: Crowd) -> dict[str, list[float]]:
    """Return the processor time of a step [us] of each round, in turns, for each column of the table: the same crowd on
    PyBullet's plane, and on a map in three ways."""
    maps = [HeightMap(np.zeros((SIDE, SIDE)), resolution=CELL, origin=(-EDGE, -EDGE)) for _ in range(3)]
    with ExitStack() as stack:
        plane, own, still, moving = (stack.enter_context(world_with(crowd, one)) for one in (None, *maps))
        own.step()
        steps = {
            "plane": plane.client.stepSimulation, "own": own.client.stepSimulation, "still": still.step,
            "moving": moving_step(moving, maps[2]),
        }  # fmt: skip
        counts = {}
        for column, step in steps.items():
            time_of(step, SETTLE)
            counts[column] = max(int(BLOCK * 1e6 / time_of(step, SETTLE)), 8)
        found: dict[str, list[float]] = {column: [] for column in steps}
        for _ in range(WORLD_ROUNDS):
            for column, step in steps.items():
                found[column].append(time_of(step, counts[column]))
        return found


def world_table() -> tuple[str, dict[str, dict[str, list[float]]]]:
    """Return the table, with the plane's time and the others' ratio to it, median, 10th and 90th percentile; and the
    times of all rounds by crowd and column."""
    logging.getLogger("smartmesh_ros").setLevel(logging.ERROR)  # what the husky's description lacks is known
    results = {name: world_times(crowd) for name, crowd in CROWDS.items()}
    rows = []
    for name, found in results.items():
        rows.append([name, number(float(np.median(found["plane"])))])
        for column in ("own", "still", "moving"):
            ratios = np.array(found[column]) / found["plane"]
            low, middle, high = np.percentile(ratios, (10, 50, 90)).tolist()
            rows[-1].append(f"{middle:.2f} ({low:.2f} to {high:.2f})")
    header = ["bodies", "plane [us]", "your own `stepSimulation`", "`World.step`, still", "`World.step`, moving"]
    return table(header, rows), results


def setup_of(crowd: Crowd, case: str, plane: bool) -> Setup:
    """Return a crowd on level ground: at rest, or rolling (balls) and sliding (boxes) at a constant speed."""
    shape, half = SHAPES[crowd.kind]
    rolls = isinstance(shape, Sphere)
    vx, vy = DRIVING if case == "driving" else (0.0, 0.0)
    spin = (-vy / half, vx / half, 0.0) if rolls else (0.0, 0.0, 0.0)
    friction = 0.0 if case == "driving" and not rolls else 0.5
    bodies = [
        EngineBody(
            shape=shape, state=BodyState((EDGE + x, EDGE + y, half), linear=(vx, vy, 0.0), angular=spin),
            friction=friction,
        )
        for x, y in crowd.places()
    ]  # fmt: skip
    return Setup(heights=np.zeros((SIDE, SIDE)), resolution=CELL, dt=1.0 / RATE, bodies=bodies, plane=plane)


def engine_time(name: str, crowd: Crowd, case: str, plane: bool) -> float:
    """Return the processor time of a step [us]. ``moving``: whole maps come at 60 Hz, whose intake counts; on a plane
    nothing moves."""
    with enter(name, setup_of(crowd, case, plane)) as engine:
        steps, comes = range(BEFORE + MEASURED), case == "moving" and not plane
        times = [step / RATE for step in steps[::EVERY]] if comes else []
        maps = [engine.ready(waves_at(time) - waves_at(0.0)) for time in times]
        begun = 0.0
        for step in steps:
            if step == BEFORE:
                begun = process_time()
            if comes and step % EVERY == 0:
                engine.set_ground(maps[step // EVERY])
            engine.step()
        return (process_time() - begun) / MEASURED * 1e6


def engine_table() -> tuple[str, dict[str, dict[str, dict[str, list[float]]]]]:
    """Return the table, with medians, and by crowd, engine and case the ratios of costs, field over plane, of each
    round, and under "plane" the plane's cost at rest [us]; all in turns."""
    found: dict[str, dict[str, dict[str, list[float]]]] = {}
    for who, crowd in CROWDS.items():
        if crowd.kind == "husky":
            continue
        found[who] = {name: {case: [] for case in ("plane", *CASES)} for name in entrants()}
        for _ in range(ENGINE_ROUNDS):
            for name, columns in found[who].items():
                planes = {case: engine_time(name, crowd, case, plane=True) for case in ("still", "driving")}
                columns["plane"].append(planes["still"])
                for case in CASES:
                    cost = engine_time(name, crowd, case, plane=False)
                    columns[case].append(cost / planes.get(case, planes["still"]))
    rows = [
        [f"{crowd}: {name}", *(number(float(np.median(columns[case]))) for case in ("plane", *CASES))]
        for crowd, engines in found.items()
        for name, columns in engines.items()
    ]
    return table(["bodies: engine", "plane [us]", "field, still", "field, driving", "field, moving"], rows), found
