"""Touchdown: a ball falls onto a deck that heaves, and should leave it with e times the speed (Newton)."""

import math
from collections.abc import Callable

import numpy as np

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.engines.engine import EngineBody, Setup
from studies.pages import number, table
from studies.records.entrants import RATE, enter, entrants

HEAVE, FREQUENCY = 0.2, math.pi  # amplitude [m] and angular frequency [rad/s] of the deck: up to 0.63 m/s
FALL = 0.3  # from release to touchdown [s]: 2.9 m/s
RESTITUTIONS, PHASES = (0.3, 0.6, 0.9), 8
BALL = Sphere(0.2)
SIDE, CELL = 21, 0.25
DT = 1.0 / RATE
PATIENCE = 0.2  # how long we wait for the ball to leave the deck [s]


def rebound(name: str, restitution: float, phase: float | None) -> float:
    """Return the share of the relative speed that a ball leaves a deck with, zero if it stays. ``phase`` [rad]: of the
    deck at touchdown, None = it is at rest. A map comes in every step."""
    heave = 0.0 if phase is None else HEAVE

    def height(time: float) -> float:
        return heave * math.sin(FREQUENCY * (time - FALL) + (phase or 0.0))

    middle, start = 0.5 * CELL * (SIDE - 1), height(FALL) + BALL.radius + 0.5 * GRAVITY * FALL**2
    body = EngineBody(shape=BALL, state=BodyState((middle + 0.03, middle + 0.02, start)), restitution=restitution)
    level = np.ones((SIDE, SIDE))
    setup = Setup(heights=height(0.0) * level, resolution=CELL, dt=DT, bodies=[body])
    with enter(name, setup) as engine:
        closing = 0.0
        for step in range(round((FALL + PATIENCE) / DT)):
            time = step * DT
            engine.set_ground(engine.ready(height(time) * level))
            gap, before = engine.positions()[0, 2] - BALL.radius - height(time), engine.velocities()[0, 2]
            engine.step()
            free = abs((engine.velocities()[0, 2] - before) / DT + GRAVITY) < 0.01 * GRAVITY
            if not closing and not free:
                closing = -speed_at_deck(height, time, gap, before)
            elif closing and free and before > (height(time + DT) - height(time - DT)) / (2.0 * DT):
                return speed_at_deck(height, time, gap, before) / closing
    return 0.0


def speed_at_deck(height: Callable[[float], float], time: float, gap: float, speed: float) -> float:
    """Return the speed [m/s] relative to a deck at ``height`` [m] where the parabola of a ball meets it that is a
    ``gap`` [m] above it at a ``time`` [s], on its way down or up. Engines add gravity before they move a body, so that
    the parabola's own speed is less by half a step of it."""
    own, base = speed - 0.5 * GRAVITY * DT, height(time) + gap
    late, relative = 0.0, 0.0
    for _ in range(20):  # Newton's method
        there = time + late
        relative = own - GRAVITY * late - (height(there + 1e-5) - height(there - 1e-5)) / 2e-5
        late -= (base + own * late - 0.5 * GRAVITY * late**2 - height(there)) / relative
    return relative


def touchdown_table() -> tuple[str, dict[str, dict[str, list[float]]]]:
    """Return the table, with the most and least of eight phases, and all figures by engine and coefficient."""
    phases = [2.0 * math.pi * k / PHASES for k in range(PHASES)]
    rows, found = [], {}
    for name in entrants():
        rest = number(rebound(name, RESTITUTIONS[1], None))
        found[name] = {f"{e}": [rebound(name, e, phase) for phase in phases] for e in RESTITUTIONS}
        rows.append([name, rest, *(f"{min(values):.3f} to {max(values):.3f}" for values in found[name].values())])
    return table(["engine", f"at rest, e = {RESTITUTIONS[1]}", *(f"e = {e}" for e in RESTITUTIONS)], rows), found
