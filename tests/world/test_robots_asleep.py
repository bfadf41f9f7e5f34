"""Robots sleep: none of their links moves for a minute, and they stand as they did awake.

Joints hold their positions, which loads their motors: these push as soon as a robot loses the ground.
"""

import math
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from smartmesh_ros import BodyState, HeightMap, JointCommand, World
from smartmesh_ros.terrain.grid import FloatArray
from tests.grounds import world_of
from tests.legged import ROBOTS, set_up
from tests.urdfs import HUSKY

RATE, MINUTE = 240, 60 * 240
APART = 3.0  # of robots in a row [m]
WHEEL = 0.1651  # the radius of the wheels of the husky [m]
# Robots of PyBullet's data that stand on the ground, or lie on it when their joints are held at zero.
KNOWN = (
    "a1/a1", "aliengo/aliengo", "bicycle/bike", "biped/biped2d_pybullet", "humanoid/humanoid", "husky/husky",
    "laikago/laikago", "laikago/laikago_toes", "laikago/laikago_toes_zup", "mini_cheetah/mini_cheetah",
    "quadruped/microtaur/microtaur", "quadruped/minitaur", "quadruped/minitaur_v1", "quadruped/minitaur_derpy",
    "quadruped/minitaur_fixed_knees", "quadruped/minitaur_rainbow_dash", "quadruped/minitaur_rainbow_dash_v1",
    "quadruped/quadruped", "quadruped/spirit40", "quadruped/spirit40newer", "quadruped/vision60", "r2d2",
    "racecar/racecar", "racecar/racecar_differential"
)  # fmt: skip


def row_world(count: int, *, sleep: bool = True) -> World:
    heights = np.zeros((61, round(APART * count / 0.1) + 61))
    return world_of(HeightMap(heights, resolution=0.1, origin=(-APART, -3.0)), sleep=sleep)


def stand(world: World, name: str, x: float) -> None:
    """Spawn a robot in its stance, 2 cm above the ground. Each joint is to hold an angle that differs from its own by
    0.02 rad, to and fro, so that friction holds the legs against each other, and their motors push."""
    set_up(world, name, x, 0.0, 0.02)
    for index, (joint, angle) in enumerate(ROBOTS[name].stance.items()):
        world.command(name, joint, JointCommand(position=angle + (0.02 if index % 3 else -0.02)))


def poses(world: World, name: str) -> FloatArray:
    """Poses of all links of a robot by PyBullet (n, 7), also of those without a shape."""
    client, uid = world.client, world.bodies[name].uid
    links = client.getLinkStates(uid, list(range(client.getNumJoints(uid))), computeForwardKinematics=1)
    base = client.getBasePositionAndOrientation(uid)
    return np.array([(*base[0], *base[1]), *((*link[0], *link[1]) for link in links)])


def lowest(world: World, name: str) -> float:
    body = world.bodies[name]
    return min(world.client.getAABB(body.uid, link)[0][2] for link in body.links)


def sleep_all(world: World) -> None:
    for _ in range(48):
        world.step(RATE // 4)
        if all(map(world.is_asleep, world.bodies)):
            return
    awake = [name for name in world.bodies if not world.is_asleep(name)]
    raise AssertionError(f"awake after 12 s: {awake}")


def require_still(world: World, steps: int = MINUTE) -> None:
    """Assert that no link of any sleeping robot moves in so many steps, nor after it wakes."""
    before = {name: poses(world, name) for name in world.bodies}
    world.step(steps)
    for name, known in before.items():
        assert world.is_asleep(name), name
        assert poses(world, name) == pytest.approx(known, abs=1e-9), name
        assert not any(world.state(name).linear), f"{name} has a velocity"
        assert not any(joint.velocity for joint in world.joints(name)), f"joints of {name} have velocities"
    assert world.rescues == 0
    world.wake()
    world.step(RATE // 2)
    for name, known in before.items():
        assert np.abs(poses(world, name)[:, :3] - known[:, :3]).max() < 0.01, f"{name} moved as it woke"
    assert world.rescues == 0
    assert not world.lost


def test_robots_stand_and_sleep_for_a_minute() -> None:
    with row_world(len(ROBOTS)) as world, row_world(len(ROBOTS), sleep=False) as awake:
        for index, name in enumerate(ROBOTS):
            for each in (world, awake):
                stand(each, name, APART * index)
        sleep_all(world)
        awake.step(4 * RATE)  # a humanoid sways for some seconds
        for name in ROBOTS:
            assert abs(world.state(name).position[2] - ROBOTS[name].height) < 0.02, f"{name} does not stand"
            assert poses(world, name) == pytest.approx(poses(awake, name), abs=2e-3), name
            assert lowest(world, name) == pytest.approx(0.0, abs=2e-3), name
        require_still(world)


def test_a_rover_drives_brakes_and_sleeps_for_a_minute_unless_its_joints_are_driven() -> None:
    """It drives for 2 s at 0.5 m/s, along x."""
    with row_world(1) as world:
        world.spawn_robot("husky", HUSKY, BodyState(), on_ground=True)

        def drive(command: JointCommand, seconds: float = 0.0) -> float:
            """Command all joints; returns how far it goes [m]."""
            start = world.state("husky").position
            for joint in world.bodies["husky"].joints:
                world.command("husky", joint, command)
            world.step(round(seconds * RATE))
            return math.dist(start, world.state("husky").position)

        assert drive(JointCommand(velocity=0.5 / WHEEL), 2.0) == pytest.approx(1.0, abs=0.1)
        assert not world.is_asleep("husky")
        drive(JointCommand(velocity=0.0))
        sleep_all(world)
        assert len(world.ground.contacts.core.find_asleep()) == len(world.followers), "it sleeps whole"
        require_still(world)
        sleep_all(world)
        drive(JointCommand(velocity=0.0))
        assert world.is_asleep("husky"), "the same commands again are none"
        assert drive(JointCommand(velocity=4.0), 1.0) > 0.1
        assert not world.is_asleep("husky"), "a robot whose joints are driven never sleeps"
        # PyBullet would sum up the efforts of all steps that it sleeps, and apply them at once as it wakes.
        drive(JointCommand(velocity=0.0), 4.0)
        drive(JointCommand(effort=1e-3), 4.0)
        assert not world.is_asleep("husky")
        world.wake()
        assert drive(JointCommand(effort=1e-3), 0.5) < 0.01


def test_robots_of_pybullets_data_sleep() -> None:
    """For five seconds; a minute of robots of all kinds is above."""
    with row_world(len(KNOWN)) as world:
        for index, path in enumerate(KNOWN):
            name, x = Path(path).name, APART * index
            world.spawn_robot(name, f"{pybullet_data.getDataPath()}/{path}.urdf", BodyState((x, 0.0, 5.0)))
            world.move(name, BodyState((x, 0.0, 5.01 - lowest(world, name))))
            for joint in world.bodies[name].joints:
                world.command(name, joint, JointCommand(position=0.0))
        sleep_all(world)
        require_still(world, 5 * RATE)


def test_a_robot_without_a_shape_of_its_root_is_noticed_if_it_moves_asleep() -> None:
    """Its root is no attached link, and only one of its joints is turned."""
    with row_world(1) as world:
        stand(world, "solo", 0.0)
        sleep_all(world)
        uid, joints = world.bodies["solo"].uid, world.bodies["solo"].joints
        world.client.resetJointState(uid, joints["front_left_knee"], -0.7)
        for _ in range(RATE):
            world.step()
            if not world.is_asleep("solo"):
                break
        assert not world.is_asleep("solo")
        sleep_all(world)
        assert world.state("solo").position[2] == pytest.approx(ROBOTS["solo"].height, abs=0.02)
