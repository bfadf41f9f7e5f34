"""Every engine does what physics says; those that are not installed are skipped by name."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, InputError, Sphere
from studies.engines.engine import ENGINES, EngineBody, Setup, Simulation, build, missing

DT = 1.0 / 240.0
G = 9.81
ROWS, COLUMNS, RESOLUTION = 21, 31, 0.2
# What an engine needs for bodies not to catch at inner edges.
OPTIONS = {"bullet_trimesh": {"edge_filter": True}}


# Robots are in test_robots.py.
@pytest.fixture(params=[name for name in ENGINES if "robots" not in name])
def engine(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    if missing(name):
        pytest.skip(f"{name}: {missing(name)}")
    return name


def ball(position: tuple[float, float, float], **state: tuple[float, float, float]) -> EngineBody:
    return EngineBody(shape=Sphere(0.25), mass=2.0, state=BodyState(position=position, **state))


def run(scene: Simulation, steps: int, heights: Callable[[float], np.ndarray] | None = None) -> None:
    """Step an engine, with a map of heights at its time [s] before each step."""
    for step in range(steps):
        if heights is not None:
            scene.set_ground(scene.ready(heights(step * DT)))
        scene.step()


def setup(heights: np.ndarray, *bodies: EngineBody) -> Setup:
    return Setup(heights=heights, resolution=RESOLUTION, bodies=bodies, dt=DT)


def test_bodies_rest_on_the_ground(engine: str) -> None:
    """On level ground that was lower and higher before, off the middle of a map that is not square."""
    level = np.full((ROWS, COLUMNS), 0.7)
    box = EngineBody(shape=Box(0.4, 0.6, 0.3), state=BodyState(position=(4.1, 1.1, 1.5)))
    with build(engine, setup(level - 2.0, ball((1.3, 2.9, 1.5)), box)) as scene:
        scene.set_ground(scene.ready(level + 0.5))
        scene.set_ground(scene.ready(level))
        run(scene, 600, lambda _: level)
        settled = scene.positions()
        assert settled[:, 2] == pytest.approx([0.7 + 0.25, 0.7 + 0.15], abs=0.004)
        run(scene, 120)
        assert scene.positions() == pytest.approx(settled, abs=0.002)


def test_map_lies_where_it_should(engine: str) -> None:
    """Two balls in two pits at known samples, whose shape tells x from y and one diagonal from the other."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    pits = ((4, 22), (15, 6))
    distance = np.min([np.hypot(row - r, column - c) for r, c in pits], axis=0)
    heights = 0.35 * np.minimum(distance * RESOLUTION, 1.0)
    bodies = [ball((c * RESOLUTION + 0.15, r * RESOLUTION - 0.1, 0.8)) for r, c in pits]
    with build(engine, setup(heights, *bodies)) as scene:
        run(scene, 1200)
        expected = [(c * RESOLUTION, r * RESOLUTION) for r, c in pits]
        assert scene.positions()[:, :2] == pytest.approx(np.array(expected), abs=0.05)  # cells are 0.2 m


def test_map_that_slides_takes_a_ball_in_a_pit_along(engine: str) -> None:
    row, column = np.mgrid[:ROWS, :COLUMNS]
    heights = 0.6 * np.hypot(row - 10, column - 10) * RESOLUTION
    start = ball((2.0, 2.0, 0.3))
    with build(engine, replace(setup(heights, start), slide=(0.5, -0.25))) as scene:
        run(scene, 480, lambda _: heights)
        x, y, z = scene.positions()[0]
        # The walls hold it within a cell of the bottom; it may go round.
        assert (x, y) == pytest.approx((3.0, 1.5), abs=RESOLUTION)
        assert 0.25 < z < 0.45


def test_only_a_surface_velocity_takes_a_box_on_level_ground_along(engine: str) -> None:
    flat = np.zeros((ROWS, COLUMNS))
    box = EngineBody(shape=Box(0.4, 0.4, 0.2), state=BodyState(position=(2.03, 2.01, 0.101)))
    cases: list[tuple[dict[str, Any], bool]] = [({}, engine == "smartmesh")]
    if engine == "mujoco":
        cases.append(({"surface_velocity": True}, True))
    for options, dragged in cases:
        with build(engine, replace(setup(flat, box), slide=(0.5, 0.0)), **options) as scene:
            run(scene, 240, lambda _: flat)
            assert scene.velocities()[0, 0] == pytest.approx(0.5 if dragged else 0.0, abs=0.02)


def test_friction_is_the_bodies_own(engine: str) -> None:
    """On gravity that leans by 0.4 a ball rolls, unless its friction is less than 2/7 of that: then it slips."""
    time, lean = 0.5, 0.4
    for friction in (0.05, 0.6):
        rolling = EngineBody(shape=Sphere(0.25), friction=friction, state=BodyState(position=(1.0, 2.0, 0.25)))
        leaning = replace(setup(np.zeros((ROWS, COLUMNS)), rolling), gravity=(lean * G, 0.0, -G))
        with build(engine, leaning, **OPTIONS.get(engine, {})) as scene:
            run(scene, round(time / DT))
            velocity, turning = scene.velocities()[0, [0, 4]]
        slips = friction < 2.0 / 7.0 * lean
        assert velocity == pytest.approx(G * time * (lean - friction if slips else 5.0 / 7.0 * lean), rel=0.05)
        within = 0.15 if engine == "rapier" else 0.1  # see its docstring
        assert turning == pytest.approx(2.5 * friction * G * time / 0.25 if slips else velocity / 0.25, rel=within)


def test_ball_stays_on_ground_that_rises(engine: str) -> None:
    if engine == "bullet_heightfield":
        pytest.skip("its ground has no velocity, and throws the ball up")
    flat = np.zeros((ROWS, COLUMNS))
    with build(engine, setup(flat, ball((3.0, 2.0, 0.25))), **OPTIONS.get(engine, {})) as scene:
        run(scene, 240, lambda time: flat + 0.5 * math.sin(2.0 * time))
        height = 0.5 * math.sin(2.0 * 239 * DT)
        assert scene.positions()[0, 2] == pytest.approx(0.25 + height, abs=0.04)


def test_unknown_engine_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="smartmesh"):
        build("jolt", setup(np.zeros((ROWS, COLUMNS))))
