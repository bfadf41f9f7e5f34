"""Effect of delay and loss on impacts: bodies in several worlds compared with bodies in one, in one process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.states import simulated_states
from studies.fleet.worlds import RATE, Start, flat_world, peers

BALL = Sphere(0.2)
# Balls bounce, and roll as they like; boxes stop.
SMOOTH = PhysicsConfig(rate=RATE, restitution=0.97, friction=0.0)
ROUGH = PhysicsConfig(rate=RATE, friction=0.3)
# Places between two steps that bodies meet at in one world.
SHIFTS = 16


@dataclass(frozen=True)
class Encounter:
    """Bodies that collide, each in its own world; ``speed`` [m/s]: of the approach. After ``steps`` velocities are
    compared, or with ``pushing`` positions."""

    name: str
    bodies: tuple[Start, ...]
    physics: PhysicsConfig
    speed: float
    steps: int = 300
    pushing: bool = False


def ball(x: float, speed: float, mass: float = 1.0, y: float = 0.0) -> Start:
    """A ball on the ground."""
    return Start(BALL, mass, x, speed, BALL.radius, y)


ENCOUNTERS = (
    Encounter("head-on", (ball(-1.0, 2.5), ball(1.0, -2.5)), SMOOTH, 5.0),
    Encounter("against a resting ball", (ball(-1.0, 3.0), ball(0.5, 0.0)), SMOOTH, 3.0),
    Encounter("heavy on light", (ball(-1.0, 3.0, 5.0), ball(0.5, 0.0)), SMOOTH, 3.0),
    Encounter("glancing", (ball(-1.0, 2.5, y=0.1), ball(1.0, -2.5, y=-0.1)), SMOOTH, 5.0),
    Encounter("Newton's cradle", (ball(-1.5, 2.0), *(ball(0.401 * k, 0.0) for k in range(3))), SMOOTH, 2.0),
    Encounter(
        "a box pushed by a heavy one",
        (Start(Box(0.6, 0.6, 0.4), 20.0, -1.5, 3.0, 0.2), Start(Box(0.4, 0.4, 0.4), 1.0, 0.0, 0.0, 0.2)),
        ROUGH, 3.0, pushing=True,
    ),
    Encounter(
        "a box pushed by a rover",
        (Start(None, 10.0, -2.0, 1.0, 0.15), Start(Box(0.4, 1.0, 0.4), 5.0, 0.0, 0.0, 0.2)),
        ROUGH, 1.0, steps=720, pushing=True,
    ),
)  # fmt: skip


def outcome(
    encounter: Encounter, shift: float, *, apart: bool, late: int = 0, loss: float = 0.0, seed: int = 0
) -> FloatArray:
    """Velocities (n, 3) [m/s] after it, or places [m]: of bodies in a world each, which step at different instants, or
    all in one. ``shift`` [steps]: where between two steps they meet."""
    away = shift * encounter.speed / RATE
    bodies = [encounter.bodies[0]._replace(x=encounter.bodies[0].x - away), *encounter.bodies[1:]]
    starts = [[body] for body in bodies] if apart else [bodies]
    with peers(starts, late, encounter.physics, loss=loss, seed=seed, phases=apart) as made:
        made.step(encounter.steps)
        states = [made.state(f"b{index}") for index in range(len(bodies))]
    return np.array([state.position if encounter.pushing else state.linear for state in states])


def references(encounter: Encounter) -> FloatArray:
    """Outcomes (k, n, 3) of one world, by where between two steps the bodies meet."""
    return np.array([outcome(encounter, shift, apart=False) for shift in np.arange(0.0, 1.0, 1.0 / SHIFTS)])


def spread(encounter: Encounter, known: FloatArray) -> float:
    """Return the spread of the outcomes of one world, as a fraction of the speed of approach, or in [m]."""
    scale = 1.0 if encounter.pushing else encounter.speed
    return float(np.linalg.norm(known[:, None] - known[None], axis=-1).max()) / scale


def error_of(encounter: Encounter, known: FloatArray, late: int, loss: float, seeds: int) -> dict[str, float]:
    """Return the distance of outcomes to the nearest outcome of one world: velocities as a fraction of the speed of
    approach, positions in [m]; the median and the maximum over the seeds."""
    scale = 1.0 if encounter.pushing else encounter.speed
    errors = []
    for seed in range(seeds):
        many = outcome(encounter, seed / seeds, apart=True, late=late, loss=loss, seed=seed)
        errors.append(float(np.linalg.norm(known - many, axis=-1).max(axis=-1).min()) / scale)
    return {"median": median(errors), "worst": max(errors)}


def errors(delays_ms: Sequence[float], losses: Sequence[float], seeds: int) -> list[dict[str, Any]]:
    """Errors of every encounter at every delay [ms] without loss, and at every loss with one step of delay."""
    cases = [(delay, 0.0) for delay in delays_ms] + [(1e3 / RATE, loss) for loss in losses if loss]
    found = []
    for encounter in ENCOUNTERS:
        known = references(encounter)
        apart = spread(encounter, known)
        for delay, loss in cases:
            error = error_of(encounter, known, round(delay * 1e-3 * RATE), loss, seeds)
            found.append(
                {"encounter": encounter.name, "pushing": encounter.pushing, "delay_ms": delay, "loss": loss,
                 "spread_of_one_world": apart, **error}
            )  # fmt: skip
    return found


def guest_cost(count: int, steps: int) -> dict[str, float]:
    """Time of a step [us] of a world with ``count`` own balls; with as many guests beside them, each as near to one as
    a guest is but in no contact; and with twice as many own balls."""
    side = int(np.ceil(np.sqrt(count)))
    times = {}
    for name, own, other in (("own", count, 0), ("guests", count, count), ("twice", 2 * count, 0)):
        with flat_world(PhysicsConfig(rate=60.0)) as world, flat_world(PhysicsConfig(rate=60.0)) as peer:
            for index in range(own + other):
                place, pair = index % count, index // count
                x, y = 0.9 * (place % side) - 10.0 + 0.45 * pair, 0.5 * (place // side) - 4.5
                host = world if index < own else peer
                host.spawn(f"b{index}", Sphere(0.1), 1.0, BodyState((x, y, 0.1)))
            taken = []
            for _ in range(steps):
                if other:
                    world.guests.take("peer", simulated_states(peer), world.time)
                start = perf_counter()
                world.step()
                taken.append(perf_counter() - start)
            times[name] = 1e6 * median(taken[steps // 4 :])
    return times
