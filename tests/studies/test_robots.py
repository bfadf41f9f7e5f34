"""The study of robots: its measure of penetration, its robots, and that every engine holds them up."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.tools.evaluation.distance import Surface, nearest
from studies.configurations import robot_configurations
from studies.engines.engine import missing
from studies.matrix.arena import square
from studies.robots import study
from studies.robots.contest import GroundPrisms, Part, hull_of, placed, pose_of, read_links, shapes_of
from studies.robots.robot import (
    HUSKY,
    LAIKAGO,
    MASSLESS,
    RACECAR,
    ROVER,
    SERVO,
    Robot,
    RobotEngine,
    RobotSetup,
    prepared,
    robot_scene,
    scenes,
)
from studies.robots.study import Stranger, run_stranger
from tests.bodies import about_z
from tests.core.contact_cases import wheel as prism

LEVEL = square(51, 0.04)
FLAT = GroundPrisms(LEVEL, np.zeros((51, 51)))
ROUGH = np.random.default_rng(3).normal(0.0, 0.02, (51, 51))
LYING = pose_of((0.0, 0.0, 0.0), (math.sin(0.25 * math.pi), 0.0, 0.0, math.cos(0.25 * math.pi)))  # its axis along y
RADIUS, WIDTH = 0.165, 0.11
near = st.floats(-0.5, 0.5)


def wheel() -> Part:
    return Part(coal.Cylinder(RADIUS, WIDTH), LYING)


def gon() -> Part:
    """A wheel as PyBullet takes a cylinder: a prism of 32 sides, of which a corner points down."""
    return Part(hull_of(placed(prism(RADIUS, WIDTH), LYING)), coal.Transform3s())


@pytest.mark.parametrize(
    ("part", "oblique"), [(wheel(), 0.0), (gon(), 1.0 - math.cos(math.pi / 32))], ids=["cylinder", "hull"]
)
@given(depth=st.floats(-0.08, 0.03), x=near, y=near, yaw=st.floats(-math.pi, math.pi))
@example(depth=0.015625, x=0.0, y=0.0, yaw=0.0)
def test_a_wheel_is_as_deep_as_sunk(part: Part, oblique: float, depth: float, x: float, y: float, yaw: float) -> None:
    """A corner that stands on the edge between two prisms leaves each of them along the normal of its own side, and is
    less deep by the share ``oblique``."""
    found = FLAT.least_clearance([[part]], np.array([[x, y, RADIUS - depth]]), np.array([about_z(yaw)]))
    assert -depth - 1e-5 <= found <= -depth + oblique * max(depth, 0.0) + 1e-5


@given(x=near, y=near, height=st.floats(0.0, 0.15), radius=st.floats(0.005, 0.1))
def test_balls_are_as_far_from_ground_as_brute_force_says(x: float, y: float, height: float, radius: float) -> None:
    surface = Surface(LEVEL, ROUGH)
    centre = np.array([[x, y, 0.0]])
    centre[0, 2] = surface.below(centre)[0] + height
    expected = nearest(surface, centre, 0.3).distance[0] - radius
    upright = np.array([[0.0, 0.0, 0.0, 1.0]])
    ball = Part(coal.Sphere(radius), coal.Transform3s())
    found = GroundPrisms(LEVEL, ROUGH).least_clearance([[ball]], centre, upright)
    assert found == pytest.approx(min(expected, 0.1), abs=1e-6)


def test_the_least_clearance_of_links_is_that_of_the_lowest_and_beside_the_map_there_is_none() -> None:
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
    places = np.array([[0.0, 0.0, 0.4], [0.3, 0.1, RADIUS - 0.002], [-0.3, 0.0, RADIUS + 0.01]])
    assert FLAT.least_clearance([[wheel()]] * 3, places, upright) == pytest.approx(-0.002, abs=1e-5)
    places[2] = 30.0, 0.0, RADIUS
    assert math.isnan(FLAT.least_clearance([[wheel()]] * 3, places, upright))


@pytest.mark.parametrize("robot", [ROVER, HUSKY, RACECAR, LAIKAGO], ids=lambda robot: robot.name)
def test_shapes_of_links_fill_the_bounds_that_pybullet_gives_them(client: Any, robot: Robot, tmp_path: Path) -> None:
    """Links that are not turned: bounds of turned ones are too large. The margin is a few millimetres."""
    file = tmp_path / "robot.urdf"
    file.write_text(prepared(robot.urdf))
    uid = client.loadURDF(str(file))
    compared = 0
    for link in range(-1, client.getNumJoints(uid)):
        if not client.getCollisionShapeData(uid, link):
            continue
        mass = client.getBasePositionAndOrientation(uid) if link < 0 else client.getLinkState(uid, link)[:2]
        inverse = client.invertTransform(*client.getDynamicsInfo(uid, link)[3:5])
        frame = pose_of(*client.multiplyTransforms(*mass, *inverse))
        if not np.allclose(pose_of(*mass).getRotation(), np.eye(3), atol=1e-6):
            continue
        [parts] = read_links(client, uid, [link])
        points = np.concatenate([placed(part.points, frame) for part in parts])
        low, high = points.min(axis=0), points.max(axis=0)
        assert np.abs([low, high] - np.array(client.getAABB(uid, link))).max() < 0.005, link
        compared += 1
    assert compared >= 1


@pytest.mark.parametrize("robot", [HUSKY, RACECAR, LAIKAGO], ids=lambda robot: robot.name)
def test_prepared_descriptions_stay_as_they_are_and_have_a_mass_for_every_link(robot: Robot) -> None:
    text = prepared(robot.urdf)
    assert prepared(text) == text
    assert "$(" not in text and "<visual" not in text
    assert text.count("<inertial") == text.count("<link")
    assert (f'value="{MASSLESS:g}"' in text) == (robot is HUSKY)


def robots_in(engine: str, robot: Robot, starts: list[list[float]]) -> RobotEngine:
    """Robots on level ground in an engine; skips the test if that is not installed."""
    [chosen] = [one for one in robot_configurations(quick=True) if one.name == engine] or [None]
    if chosen is None:
        pytest.skip(f"{engine}: {missing('mujoco') or missing('physx')}")
    return chosen.build(RobotSetup(
        robot=robot, text=prepared(robot.urdf), starts=np.array(starts), heights=np.zeros((51, 51), np.float32),
        resolution=0.04, origin=(-1.0, -1.0), dt=1.0 / 240.0,
    ))  # fmt: skip


@pytest.mark.parametrize("engine", ["defaults", "whole heightfield", "MuJoCo tuned, 240 Hz", "PhysX, 240 Hz"])
def test_every_engine_holds_a_braked_rover_up(engine: str) -> None:
    starts, shapes = [[-0.5, -0.4, 0.13], [0.5, 0.4, 0.13]], shapes_of(prepared(ROVER.urdf), prisms=False)
    with robots_in(engine, ROVER, starts) as robots:
        for _ in range(180):
            robots.step()
        links = robots.links()
        parts = [shapes[name] for name in robots.names]
        assert np.abs(robots.velocities()).max() < 0.01
        for positions, orientations, start in zip(*links, starts, strict=True):
            assert FLAT.least_clearance(parts, positions, orientations) == pytest.approx(0.0, abs=2e-3)
            chassis = positions[robots.names.index("chassis")]
            assert chassis == pytest.approx([*start[:2], 0.12], abs=5e-3)


def test_a_stranger_with_braked_joints_stays_on_rough_ground() -> None:
    found = run_stranger("r2d2", moving=False, braked=True)
    assert found.rescues == 0
    assert found.drift < 2e-3


def test_scenes_have_names_of_their_own_and_all_robots_start_above_the_ground() -> None:
    found = scenes()
    assert len({scene.name for scene in found}) == len(found)
    assert {scene.name for scene in found if scene.quick} < {scene.name for scene in found}
    for scene in found:
        levels = scene.surface(0.0).below(scene.starts)
        assert (scene.starts[:, 2] - scene.robot.height >= levels).all(), scene.name


def test_the_study_writes_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What needs rescues or leaves the map is marked."""
    small = replace(robot_scene(ROVER, "maps", 0.25), quick=True, duration=0.5, settle=0.25)
    good = Stranger(name="r2d2", moving=False, braked=True, drift=0.001, rescues=0)
    monkeypatch.setattr(study, "scenes", lambda: [small])
    strangers = [good, good._replace(drift=math.nan), good._replace(rescues=1)]
    monkeypatch.setattr(study, "run_strangers", lambda *_, **__: strangers)
    assert study.main(["--quick", "--out", str(tmp_path)]) == 0
    for name in ("robot_tables.md", "robot_charts.md", f"images/robots/{small.name}.png"):
        assert (tmp_path / name).stat().st_size > 500, name
    charts = (tmp_path / "robot_charts.md").read_text().splitlines()
    assert ["**no**" in line for line in charts if "r2d2" in line] == [False, True, True]
    with pytest.raises(SystemExit, match="2"):
        study.main(["--scenes", "no such scene"])


@pytest.mark.parametrize("engine", ["defaults", "MuJoCo tuned, 240 Hz", "PhysX, 240 Hz"])
def test_servos_of_all_engines_approach_their_position_alike(engine: str) -> None:
    """In the air the error of a joint shrinks with the time constant of the servo."""
    knee = "FR_lower_leg_2_upper_leg_joint"

    def toe(robots: RobotEngine) -> float:
        """Distance of a toe from its upper leg [m], which depends on the knee alone."""
        positions = robots.links().positions[0]
        return math.dist(*(positions[robots.names.index(name)] for name in ("toeFR", "FR_upper_leg")))

    with robots_in(engine, LAIKAGO, [[0.0, 0.0, 5.0]]) as robots:
        robots.hold(LAIKAGO.stance)
        path = []
        for step in range(96):
            robots.hold({**LAIKAGO.stance, knee: LAIKAGO.stance[knee] - (0.3 if step >= 24 else 0.0)})
            robots.step()
            path.append(toe(robots))
    first, last = path[22], path[-1]
    after = path[24 + round(240.0 * SERVO) - 1]
    assert (after - last) / (first - last) == pytest.approx(math.exp(-1.0), abs=0.12)
