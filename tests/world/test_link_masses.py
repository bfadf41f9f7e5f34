"""Links without <inertial> have no mass, and the user is told which."""

import pytest

from smartmesh_ros import BodyState, JointCommand, World
from tests.grounds import said_by
from tests.urdfs import joint, link, robot

BOX = '<box size="0.4 0.4 0.2"/>'
BASE = link("base", BOX, 2.0, 0.05)
LIMIT = '<limit effort="5" velocity="50"/>'


def frame(name: str, on: str) -> str:
    return link(name, "", None) + joint(f"of {name}", "fixed", on, name, xyz="0 0 0")


def spawned(world: World, links: str, above: float | None = None) -> list[str]:
    """Spawn a robot at a height [m], or on the ground; what the user is told."""
    said = said_by(world)
    world.note = world.say
    world.spawn_robot("robot", robot(links), BodyState((0.0, 0.0, above or 0.0)), on_ground=above is None)
    return said


def test_frames_fixed_to_a_robot_weigh_nothing(world: World) -> None:
    frames = "".join(frame(f"frame_{i}", "base") for i in range(4))
    [said] = spawned(world, BASE + frames + frame("on_frame", "frame_0"))
    assert world.bodies["robot"].mass == pytest.approx(2.0), "7 kg, if each of the five weighed one"
    world.step(240)
    assert sum(wrench.force[2] for wrench in world.wrenches()) == pytest.approx(2.0 * 9.81, rel=0.01)
    names = "frame_0, on_frame, frame_1, frame_2, frame_3"
    assert said == f"robot 'robot': links without <inertial> have no mass: {names}"


def test_a_massless_link_between_two_joints_moves_with_the_mass_beyond(world: World) -> None:
    """A pan and tilt head whose middle link is only a frame."""
    arm = link("pan", "", None) + joint("pan", "continuous", "base", "pan", LIMIT, "0 0 0.2", "0 0 1")
    arm += link("sensor", "", 0.0, 0.0) + joint("j", "fixed", "base", "sensor")  # nothing is said of a mass of zero
    arm += link("tilt", "", 0.5, 0.002) + joint("tilt", "continuous", "pan", "tilt", LIMIT, "0.1 0 0")
    [said] = spawned(world, BASE + arm)
    assert said.endswith("have no mass: pan")
    assert world.bodies["robot"].mass == pytest.approx(2.5)
    for name, target in (("pan", 0.7), ("tilt", -0.4)):
        world.command("robot", name, JointCommand(position=target))
    world.step(480)
    assert [reading.position for reading in world.joints("robot")] == pytest.approx([0.7, -0.4], abs=0.01)


def test_wheels_without_mass_get_one_and_roll(world: World) -> None:
    """Without any mass to move, a joint would be locked."""
    wheels = "".join(
        link(f"wheel_{x}_{y}", mass=None)
        + joint(f"j_{x}_{y}", "continuous", "base", f"wheel_{x}_{y}", LIMIT, f"{0.2 * x} {0.3 * y} -0.1")
        for x in (-1, 1)
        for y in (-1, 1)
    )
    [said] = spawned(world, BASE + wheels)
    assert "weigh 1 kg each" in said and said.count("wheel_") == 4
    assert world.bodies["robot"].mass == pytest.approx(6.0)
    for name in world.bodies["robot"].joints:
        world.command("robot", name, JointCommand(velocity=5.0))
    world.step(240)
    start = world.state("robot").position[0]
    world.step(240)
    assert world.state("robot").position[0] - start == pytest.approx(5.0 * 0.1, rel=0.03)


def test_a_robot_without_any_inertial_has_the_mass_of_its_root(world: World) -> None:
    note, warning = spawned(world, link("base", BOX, None) + frame("frame", "base"))
    assert "have no mass: frame" in note and "weigh 1 kg each" in warning and warning.count("base") == 1
    assert world.bodies["robot"].mass == pytest.approx(1.0)


@pytest.mark.parametrize("inertial", [0.0, None], ids=["mass 0", "no inertial"])
def test_a_root_without_mass_is_one_body_with_what_is_fixed_to_it(world: World, inertial: float | None) -> None:
    """PAL's base_footprint: the robot falls, and its frames and names are those of the URDF."""
    box = '<box size="0.5 0.5 0.2"/>'
    links = link("base_footprint", "", inertial) + link("frame", "", 0.0) + link("base_link", box, 30.0)
    links += joint("f", "fixed", "base_footprint", "frame", xyz="0 0 0.04")
    [said] = spawned(world, links + joint("g", "fixed", "frame", "base_link", xyz="0 0 0.06"), 0.3)
    assert "base_footprint" in said and "merged with link 'base_link'" in said
    assert world.bodies["robot"].mass == pytest.approx(30.0)
    assert list(world.bodies["robot"].links.values()) == ["base_link"]
    assert world.base_state("robot").position[2] == pytest.approx(0.3, abs=1e-6)
    world.step(24)
    assert world.state("robot").linear[2] == pytest.approx(-9.81 * 24 / 240.0, rel=1e-6), "free fall"
    world.step(456)
    assert world.base_state("robot").position[2] == pytest.approx(0.0, abs=2e-3)
    assert sum(wrench.force[2] for wrench in world.wrenches()) == pytest.approx(30.0 * 9.81, rel=0.02)


@pytest.mark.parametrize("name", ["world", "plinth"])
def test_a_root_that_stands_for_the_world_stays(world: World, name: str) -> None:
    root = link(name, "", None if name == "world" else 0.0)
    arm = link("arm") + joint("j", "fixed" if name == "world" else "continuous", name, "arm")
    [said] = spawned(world, root + arm, 1.0)
    assert name in said and "not move" in said and ("mass" in said) == (name != "world")
    world.step(120)
    assert world.base_state("robot").position[2] == pytest.approx(1.0)
