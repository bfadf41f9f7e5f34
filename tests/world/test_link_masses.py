"""Links without <inertial> have no mass, and the user is told which."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, World
from smartmesh_ros.world.joints import JointCommand

BOX = '<collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision>'
BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
FIXED = '<joint name="{0}" type="fixed"><parent link="{1}"/><child link="{0}"/></joint>'
HINGE = (
    '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{0}"/><origin xyz="{2}"/><axis xyz="{3}"/>'
    '<limit effort="5" velocity="50"/></joint>'
)


def inertial(mass: float, moment: float = 0.05) -> str:
    return (
        f'<inertial><mass value="{mass}"/>'
        f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


BASE = f'<link name="base">{inertial(2.0)}{BOX}</link>'


def spawned(world: World, links: str) -> list[str]:
    """Spawns a robot on the ground; what the user is told."""
    said: list[str] = []
    world.say = said.append
    world.spawn_robot("robot", f'<robot name="r">{links}</robot>', BodyState(), on_ground=True)
    return said


def weight(world: World) -> float:
    """Force of the ground on the robot, a mean over its last steps [N]."""
    world.step(240)
    forces = []
    for _ in range(24):
        world.step()
        forces.append(sum(wrench.force[2] for wrench in world.wrenches()))
    return float(np.mean(forces))


def test_frames_fixed_to_a_robot_weigh_nothing(world: World) -> None:
    frames = "".join(f'<link name="frame_{i}"/>' + FIXED.format(f"frame_{i}", "base") for i in range(4))
    frames += '<link name="on_frame"/>' + FIXED.format("on_frame", "frame_0")
    [said] = spawned(world, BASE + frames)
    assert world.bodies["robot"].mass == pytest.approx(2.0), "7 kg, if each of the five weighed one"
    assert weight(world) == pytest.approx(2.0 * 9.81, rel=0.01)
    names = "frame_0, on_frame, frame_1, frame_2, frame_3"
    assert said == f"robot 'robot': links without <inertial> have no mass: {names}"


def test_nothing_is_said_of_links_that_have_a_mass(world: World) -> None:
    assert spawned(world, BASE + f'<link name="a">{inertial(0.0, 0.0)}</link>' + FIXED.format("a", "base")) == []


def test_a_massless_link_between_two_joints_moves_with_the_mass_beyond(world: World) -> None:
    """A pan and tilt head whose middle link is only a frame."""
    arm = f'<link name="pan"/>{HINGE.format("pan", "base", "0 0 0.2", "0 0 1")}'
    arm += f'<link name="tilt">{inertial(0.5, 0.002)}</link>{HINGE.format("tilt", "pan", "0.1 0 0", "0 1 0")}'
    [said] = spawned(world, BASE + arm)
    assert "have no mass: pan" in said
    assert world.bodies["robot"].mass == pytest.approx(2.5)
    for joint, target in (("pan", 0.7), ("tilt", -0.4)):
        world.command("robot", joint, JointCommand(position=target))
    world.step(480)
    assert [joint.position for joint in world.joints("robot")] == pytest.approx([0.7, -0.4], abs=0.01)


def test_wheels_without_mass_get_one_and_roll(world: World) -> None:
    """Without any mass to move, a joint would be locked."""
    wheels = "".join(
        f'<link name="wheel_{x}_{y}">{BALL}</link>'
        + HINGE.format(f"wheel_{x}_{y}", "base", f"{0.2 * x} {0.3 * y} -0.1", "0 1 0")
        for x in (-1, 1)
        for y in (-1, 1)
    )
    [said] = spawned(world, BASE + wheels)
    assert "weigh 1 kg each" in said and said.count("wheel_") == 4
    assert world.bodies["robot"].mass == pytest.approx(6.0)
    for joint in world.bodies["robot"].joints:
        world.command("robot", joint, JointCommand(velocity=5.0))
    world.step(240)
    start = world.state("robot").position[0]
    world.step(240)
    assert world.state("robot").position[0] - start == pytest.approx(5.0 * 0.1, rel=0.03)


def test_a_robot_without_any_inertial_has_the_mass_of_its_root(world: World) -> None:
    [said] = spawned(world, f'<link name="base">{BOX}</link><link name="frame"/>' + FIXED.format("frame", "base"))
    assert "have no mass: frame" in said and "weigh 1 kg each" in said and said.count("base") == 1
    assert world.bodies["robot"].mass == pytest.approx(1.0)


def test_a_root_called_world_needs_no_mass(world: World) -> None:
    [said] = spawned(world, f'<link name="world"/>{BASE}{FIXED.format("base", "world")}')
    assert "does not move" in said and "mass" not in said
    assert world.bodies["robot"].mass == pytest.approx(2.0)
