"""Contacts worked out from the map itself."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import BodyState, Ground, HeightMap
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Sphere
from tests.bodies import LYING, ground_of, run
from tests.grounds import end_of, level, moving, world_of
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0


@pytest.mark.parametrize("speed", [0.01, 0.05, 2.0])
@pytest.mark.parametrize("shape", [Sphere(0.2), Cylinder(radius=0.1, height=0.3), Capsule(radius=0.1, height=0.3)])
def test_rollers_keep_their_speed_and_roll_straight(shape: Shape, speed: float) -> None:
    """For 10 s, up to 20 m."""
    radius = 0.2 if isinstance(shape, Sphere) else 0.1
    ground = HeightMap(np.zeros((21, 501)), resolution=0.05, origin=(-2.0, -0.5))
    start = BodyState((-1.0, 0.011, radius), LYING, (speed, 0.0, 0.0), (0.0, speed / radius, 0.0))
    end = end_of(ground, shape, start, 2400, sleep=False)
    assert end.linear[0] == pytest.approx(speed, rel=0.01)
    assert abs(end.position[1] - 0.011) < 5e-3
    assert end.position[0] > -1.0 + 9.75 * speed


@pytest.mark.parametrize("rate", [240.0, 960.0, 2000.0])
def test_ground_that_heaves_throws_nothing_however_short_the_step(rate: float) -> None:
    """By 0.1 m once a second, known by 20 maps a second: what a map corrects is no reason to throw a body."""

    def heave(time: float) -> float:
        return 0.1 * math.sin(2.0 * math.pi * time)

    with world_of(level(201, 0.05), rate=rate, sleep=False) as world:
        world.spawn("box", Box(0.3, 0.3, 0.3), 1.0, BodyState((0.01, 0.02, 0.15)))
        for _ in moving(world, heave, round(3.0 * rate), every=round(rate / 20.0)):
            assert world.time < 1.5 or world.state("box").position[2] - 0.15 - heave(world.time) < 0.01


WHEELED = f"{pybullet_data.getDataPath()}/racecar/racecar.urdf"


def test_contacts_of_a_robot_at_rest_are_those_that_a_step_may_close(client: Any) -> None:
    """Others would cost the solver time in each step, and do nothing."""
    heights = np.random.default_rng(5).normal(scale=0.01, size=(101, 101))
    robot = client.loadURDF(WHEELED, (0.0, 0.0, 0.1))
    run(ground_of(client, HeightMap(heights, resolution=0.04, origin=(-2.0, -2.0)), robot), 480)
    distances = [contact[8] for contact in client.getContactPoints(robot)]
    assert len(distances) >= 3
    assert max(distances) < 2e-3


FEET = (0.6, -0.6)


def lander(plate: float) -> str:
    """A body on four sliding legs, with foot plates of this thickness [m]."""
    limit = '<limit lower="-0.1" upper="0.5" effort="10000" velocity="100"/>'
    legs = [
        link(f"foot_{x}_{y}", f'<box size="0.2 0.2 {plate}"/>', 5.0, 0.03)
        + joint(f"leg_{x}_{y}", "prismatic", "body", f"foot_{x}_{y}", limit, f"{x} {y} -0.9", "0 0 1")
        for x in FEET
        for y in FEET
    ]
    return robot(link("body", "", 200.0, 50.0), *legs)


def stroke(client: Any, urdf: Path, height: float, speed: float, *, from_map: bool) -> float:
    """Return how far springs and dampers let the legs of a lander in [m]; its body falls from ``height`` [m]."""
    client.resetSimulation()
    client.setGravity(0.0, 0.0, -9.81)
    robot = client.loadURDF(str(urdf), (0.0, 0.0, height))
    client.resetBaseVelocity(robot, (0.0, 0.0, -speed))
    legs, longest = range(len(FEET) ** 2), 0.0
    client.setJointMotorControlArray(robot, legs, pb.VELOCITY_CONTROL, forces=[0.0] * len(legs))
    ground = ground_of(client, level(201, 0.05), *[robot] * from_map)
    if not from_map:
        client.createMultiBody(0.0, client.createCollisionShape(pb.GEOM_PLANE))
    for _ in range(120):
        places, rates = np.array([state[:2] for state in client.getJointStates(robot, legs)]).T
        longest = max(longest, places.max())
        client.setJointMotorControlArray(robot, legs, pb.TORQUE_CONTROL, forces=-8000.0 * places - 700.0 * rates)
        client.stepSimulation()
    ground.close()
    return longest


@pytest.mark.parametrize("speed", [2.0, 3.0])
@pytest.mark.parametrize("plate", [0.01, 0.02])
def test_a_lander_takes_the_same_stroke_at_each_phase_of_the_step(
    client: Any, plate: float, speed: float, tmp_path: Path
) -> None:
    (tmp_path / "lander.urdf").write_text(lander(plate))
    heights = [0.9 + 0.5 * plate + speed * DT * (4.0 + phase / 6) for phase in range(6)]
    of_map, of_plane = (
        [stroke(client, tmp_path / "lander.urdf", height, speed, from_map=from_map) for height in heights]
        for from_map in (True, False)
    )
    assert of_map == pytest.approx(of_plane, rel=0.05)
    assert max(of_map) < 1.01 * min(of_map)


def test_a_wheel_of_many_corners_rolls_on(client: Any) -> None:
    """Its corners turn away as they come down: it hardly hops, and loses little more speed than in short steps."""
    turns = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    rim = np.stack([0.3 * np.cos(turns), 0.0 * turns, 0.3 * np.sin(turns)], axis=1)
    shape = client.createCollisionShape(
        pb.GEOM_MESH, vertices=np.concatenate([rim - (0, 0.1, 0), rim + (0, 0.1, 0)]).tolist()
    )
    ground = Ground(client, HeightMap(np.zeros((21, 301)), resolution=0.1, origin=(-1.0, -1.0)))
    ends, highest = [], 0.0
    for rate in (240.0, 1920.0):
        client.setTimeStep(1.0 / rate)
        wheel = client.createMultiBody(10.0, shape, basePosition=(0.0, 0.013, 0.3), useMaximalCoordinates=1)
        client.changeDynamics(wheel, -1, lateralFriction=0.8, collisionMargin=1e-4)
        client.changeDynamics(wheel, -1, linearDamping=0.0, angularDamping=0.0)
        client.resetBaseVelocity(wheel, (20.0, 0.0, 0.0), (0.0, 20.0 / 0.3, 0.0))
        ground.attach(wheel)
        for step in range(round(rate)):
            ground.step(step / rate, 1.0 / rate)
            if rate == 240.0:
                highest = max(highest, client.getBasePositionAndOrientation(wheel)[0][2])
        ends.append(client.getBaseVelocity(wheel)[0][0])
        ground.detach(wheel)
        client.removeBody(wheel)
    assert highest < 0.3 + 2e-3
    assert ends[0] == pytest.approx(ends[1], rel=0.06)


@pytest.mark.parametrize("spin", [20.0, 60.0])
def test_a_plate_that_spins_beside_the_ground_without_touching_it_is_left_alone(spin: float) -> None:
    start = BodyState((0.0, 0.0, 0.3 * math.sqrt(2.0) + 1e-3), angular=(0.0, spin, 0.0))
    end = end_of(level(), Box(0.6, 0.05, 0.6), start, 240, gravity=(0.0, 0.0, 0.0), sleep=False)
    assert (*end.linear, *end.angular) == pytest.approx((0.0, 0.0, 0.0, 0.0, spin, 0.0), abs=1e-9)
