"""Terrain tax of `World`: processor time of a step on a map, over that of the same bodies on PyBullet's plane."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from time import thread_time

import numpy as np
import pybullet as pb

from smartmesh_ros import BodyState, Box, HeightMap, Sphere, World
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.world.world import WorldConfig
from studies.markdown import number, table
from studies.robots.robot import HUSKY

RATE, MAP_RATE = 240, 60  # of physics and of maps [Hz]
SIDE, CELL = 121, 0.25  # samples and resolution [m] of the map
SPACING = 1.2  # between bodies [m]
ROBOT_SPACING = 3.0
BALL, BOX = Sphere(0.2), Box(0.4, 0.3, 0.2)
RISE, RISE_RATE = 0.05, 2.0  # of the moving ground: amplitude [m], angular frequency [rad/s]
# Time of one measurement [s], and how long bodies settle before [steps].
BLOCK, SETTLE = 0.03, 240


@dataclass(frozen=True)
class Crowd:
    """Bodies of one kind, or robots."""

    kind: str
    count: int

    @property
    def name(self) -> str:
        """As in the table."""
        plural = {"box": "boxes", "husky": "huskies"}.get(self.kind, self.kind + "s")
        return f"{self.count} {self.kind if self.count == 1 else plural}"


CROWDS = (
    Crowd("ball", 1), Crowd("box", 1), Crowd("husky", 1), Crowd("ball", 100), Crowd("box", 100), Crowd("husky", 8),
)  # fmt: skip


def level() -> HeightMap:
    """Return level ground, with its middle at the origin."""
    edge = -0.5 * CELL * (SIDE - 1)
    return HeightMap(np.zeros((SIDE, SIDE)), resolution=CELL, origin=(edge, edge))


def places(crowd: Crowd) -> list[tuple[float, float]]:
    """Return where the members of a crowd stand, in a square [m]."""
    side = int(np.ceil(np.sqrt(crowd.count)))
    spacing = ROBOT_SPACING if crowd.kind == "husky" else SPACING
    middle = 0.5 * (side - 1)
    return [(spacing * (k // side - middle) + 0.03, spacing * (k % side - middle) + 0.03) for k in range(crowd.count)]


def world_with(crowd: Crowd, ground: HeightMap | None) -> World:
    """Return a world in which a crowd stands in a square. No body may sleep, since sleep costs nothing anywhere."""
    world = World(ground, WorldConfig(physics=PhysicsConfig(rate=RATE, sleep=False)))
    if ground is None:
        plane = world.client.createMultiBody(0.0, world.client.createCollisionShape(pb.GEOM_PLANE))
        world.client.changeDynamics(plane, -1, lateralFriction=1.0)
    for k, (x, y) in enumerate(places(crowd)):
        if crowd.kind == "husky":
            world.spawn_robot(f"husky_{k}", HUSKY.urdf, BodyState((x, y, HUSKY.height + 0.15)))
            continue
        shape = BALL if crowd.kind == "ball" else BOX
        half = BALL.radius if crowd.kind == "ball" else 0.5 * BOX.z
        world.spawn(f"body_{k}", shape, 1.0, BodyState((x, y, half)))
    return world


def moving_step(world: World, ground: HeightMap) -> Callable[[], None]:
    """Return a step on ground that a map moves every few steps; its intake counts."""
    x = np.tile(np.linspace(-1.0, 1.0, SIDE), (SIDE, 1))
    every, steps = RATE // MAP_RATE, 0
    period = round(2.0 * np.pi / RISE_RATE * MAP_RATE)
    maps = [(RISE * np.sin(RISE_RATE * k / MAP_RATE + x)).astype(np.float32) for k in range(period)]

    def step() -> None:
        nonlocal steps
        if steps % every == 0:
            ground.replace(maps[steps // every % period], time=world.time)
        steps += 1
        world.step()

    return step


def steps_of(crowd: Crowd, stack: ExitStack) -> dict[str, Callable[[], None]]:
    """Return a step of each column of the table: the same crowd on PyBullet's plane, and on a map in three ways."""
    grounds = {"plane": None, "own": level(), "still": level(), "moving": (ground := level())}
    worlds = {column: stack.enter_context(world_with(crowd, one)) for column, one in grounds.items()}
    worlds["own"].step()
    return {
        "plane": worlds["plane"].client.stepSimulation,
        "own": worlds["own"].client.stepSimulation,
        "still": worlds["still"].step,
        "moving": moving_step(worlds["moving"], ground),
    }


def cost_of(step: Callable[[], None], steps: int) -> float:
    """Return the processor time of a step [us]."""
    begun = thread_time()
    for _ in range(steps):
        step()
    return (thread_time() - begun) / steps * 1e6


def measure(crowd: Crowd, rounds: int) -> dict[str, list[float]]:
    """Return for each column the processor time of a step [us] in turn with the others (rounds,)."""
    with ExitStack() as stack:
        steps = steps_of(crowd, stack)
        counts = {}
        for column, step in steps.items():
            cost_of(step, SETTLE)
            counts[column] = max(int(BLOCK * 1e6 / cost_of(step, SETTLE)), 8)
        found: dict[str, list[float]] = {column: [] for column in steps}
        for _ in range(rounds):
            for column, step in steps.items():
                found[column].append(cost_of(step, counts[column]))
        return found


def row_of(name: str, found: dict[str, list[float]]) -> list[str]:
    """Return a row: the plane's time, and of the others the ratio to it: median, 10th and 90th percentile."""
    plane = np.array(found["plane"])
    cells = [name, number(float(np.median(plane)))]
    for column in ("own", "still", "moving"):
        low, middle, high = np.percentile(np.array(found[column]) / plane, (10, 50, 90)).tolist()
        cells.append(f"{middle:.2f} ({low:.2f} to {high:.2f})")
    return cells


def world_table(rounds: int) -> tuple[str, dict[str, dict[str, list[float]]]]:
    """Return the table, and the times of all rounds by crowd and column."""
    logging.getLogger("smartmesh_ros").setLevel(logging.ERROR)  # what the husky's description lacks is known
    results = {crowd.name: measure(crowd, rounds) for crowd in CROWDS}
    header = ["bodies", "plane [us]", "your own `stepSimulation`", "`World.step`, still", "`World.step`, moving"]
    return table(header, [row_of(name, found) for name, found in results.items()]), results
