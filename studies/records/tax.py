"""Terrain tax of engines: a step on a level height field over one on the engine's own plane, with the same bodies."""

from __future__ import annotations

from time import process_time

import numpy as np

from smartmesh_ros import BodyState
from studies.engines.engine import EngineBody, Setup
from studies.markdown import number, table
from studies.records.entrants import RATE, enter, entrants
from studies.records.world_tax import BALL, BOX, CELL, CROWDS, MAP_RATE, RISE, RISE_RATE, SIDE, Crowd, places

# Bodies move at this speed along no axis of the map [m/s], and nothing slows them down.
MIDDLE = 0.5 * CELL * (SIDE - 1)  # of the map [m]
SPEED, ALONG = 1.0, np.array([0.8, 0.6])
# Steps of a measurement, and those before it, in which bodies settle.
MEASURED, SETTLE = 240, 24
CASES = ("still", "driving", "moving")


def setup_of(crowd: Crowd, case: str, plane: bool) -> Setup:
    """Return a crowd on level ground: at rest, or rolling (balls) and sliding (boxes) at a constant speed."""
    ball, drives = crowd.kind == "ball", case == "driving"
    height = BALL.radius if ball else 0.5 * BOX.z
    vx, vy = SPEED * drives * ALONG
    spin = (-vy / BALL.radius, vx / BALL.radius, 0.0) if ball else (0.0, 0.0, 0.0)
    bodies = [
        EngineBody(
            shape=BALL if ball else BOX,
            state=BodyState((MIDDLE + x, MIDDLE + y, height), linear=(vx, vy, 0.0), angular=spin),
            friction=0.0 if drives and not ball else 0.5,
        )
        for x, y in places(crowd)
    ]
    return Setup(heights=np.zeros((SIDE, SIDE)), resolution=CELL, dt=1.0 / RATE, bodies=bodies, plane=plane)


def cost_of(name: str, crowd: Crowd, case: str, plane: bool) -> float:
    """Return the processor time of a step [us]. ``moving``: the map heaves and tilts, and whole maps come at 60 Hz,
    whose intake counts; on a plane nothing moves."""
    every, x = RATE // MAP_RATE, np.tile(np.linspace(-1.0, 1.0, SIDE), (SIDE, 1))
    with enter(name, setup_of(crowd, case, plane)) as engine:
        comes = case == "moving" and not plane
        steps = range(SETTLE + MEASURED)
        times = [step / RATE for step in steps[::every]] if comes else []
        maps = [engine.ready(RISE * (np.sin(RISE_RATE * time + x) - np.sin(x))) for time in times]
        begun = 0.0
        for step in steps:
            if step == SETTLE:
                begun = process_time()
            if comes and step % every == 0:
                engine.set_ground(maps[step // every])
            engine.step()
        return (process_time() - begun) / MEASURED * 1e6


def measure(crowd: Crowd, rounds: int) -> dict[str, dict[str, list[float]]]:
    """Return by engine and case the ratios of costs, field over plane, of each round, and under "plane" the plane's
    cost at rest [us]; all in turns."""
    found: dict[str, dict[str, list[float]]] = {name: {case: [] for case in ("plane", *CASES)} for name in entrants()}
    for _ in range(rounds):
        for name, columns in found.items():
            planes = {case: cost_of(name, crowd, case, plane=True) for case in ("still", "driving")}
            columns["plane"].append(planes["still"])
            for case in CASES:
                columns[case].append(cost_of(name, crowd, case, plane=False) / planes.get(case, planes["still"]))
    return found


def tax_table(rounds: int) -> tuple[str, dict[str, dict[str, dict[str, list[float]]]]]:
    """Return the table, with medians, and all figures by crowd, engine and case."""
    crowds = [crowd for crowd in CROWDS if crowd.kind != "husky"]
    found = {crowd.name: measure(crowd, rounds) for crowd in crowds}
    rows = [
        [f"{crowd}: {name}", *(number(float(np.median(columns[case]))) for case in ("plane", *CASES))]
        for crowd, engines in found.items()
        for name, columns in engines.items()
    ]
    return table(["bodies: engine", "plane [us]", "field, still", "field, driving", "field, moving"], rows), found
