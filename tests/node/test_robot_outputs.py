"""Names and outputs of robots: of those of one link as of others, under names that stay, and commands by these."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from simulation_interfaces.msg import Result
from simulation_interfaces.srv import GetEntityBounds, GetEntityInfo, GetEntityState
from smartmesh_msgs.msg import BodyDescriptionArray

from smartmesh_ros import BodyState, World
from smartmesh_ros.node.inputs.conversions import RobotNames, joint_commands_from
from smartmesh_ros.tools.testing import Probe
from smartmesh_ros.world.joints import JointCommand
from tests.node.shared import LATCHED, body_names, on_level, show_level_ground
from tests.node.shared import spawn as spawn_body
from tests.urdfs import joint, link, robot

SHARED = {"simulation_interfaces": True, "frame_id": "map"}
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="50"/>'
BOX = '<box size="0.4 0.4 0.2"/>'
BASE = link("base", BOX, 2.0, 2.0)
STIFF = {
    "one_link": BASE,
    "fixed_links": BASE + link("lidar", "", None) + joint("j", "fixed", "base", "lidar", xyz="0 0 0"),
    "without_inertial": link("base", BOX, None),
    "without_mass": link("base", BOX, 0.0, 0.0),
    "held": link("world", "", None) + BASE + joint("j", "fixed", "world", "base", xyz="0 0 1"),
}


def spawn(probe: Probe, name: str, links: str, x: float = 2.0, **more: Any) -> None:
    spawn_body(probe, name, (x, 2.0, 0.1), urdf=robot(links), **more)


def test_robots_that_cannot_move_their_links_are_published(shared: Probe) -> None:
    kinds = list(STIFF)
    show_level_ground(shared)
    for place, kind in enumerate(kinds):
        spawn(shared, kind, STIFF[kind], 0.5 + place)
    shared.wait_for(lambda: set(body_names(shared)) == set(kinds))
    described = shared.listen("body_descriptions", BodyDescriptionArray, LATCHED)  # late
    shared.wait_for(lambda: described and {body.id for body in described[-1].bodies} == set(kinds))
    message = shared.latest("joint_states")
    assert (list(message.name), list(message.position)) == ([], [])
    shared.latest("odometry")
    places = {wrench.body_id: wrench.centre.z for wrench in shared.latest("contact_wrenches").wrenches}
    assert set(places) == {f"{kind}/base" for kind in kinds}
    assert np.isfinite(list(places.values())).all()
    for kind in kinds:
        for service, request in (
            ("get_entity_state", GetEntityState),
            ("get_entity_info", GetEntityInfo),
            ("get_entity_bounds", GetEntityBounds),
        ):
            assert shared.call(service, request, entity=kind).result.result == Result.RESULT_OK
    for topic in ("patches", "collider_patches", "contacts"):
        shared.latest(topic)


ARM = (
    BASE
    + link("arm", "", 0.1, 0.1)
    + joint("hinge", "continuous", "base", "arm", '<limit effort="5" velocity="50"/>', "0.1 0.2 0.3", "0 0 1")
    + link("slider", "", 0.1, 0.1)
    + joint("slide", "prismatic", "arm", "slider", LIMIT, "0 0 0", "1 0 0")
)
JOINTS = ["hinge", "slide"]


def test_names_stay_whatever_robots_come_and_go() -> None:
    with on_level(keep=["joint_states", "odometry"]) as run:

        def names(*, joints: list[str], roots: set[str]) -> bool:
            """Whether these are the names of joints, and the child frames of the odometry."""
            run.received("odometry").clear()
            run.run(run.time + 0.1)
            found = {message.child_frame_id for message in run.received("odometry")[2:]}
            return list(run.received("joint_states")[-1].name) == joints and found == roots

        def add(name: str, links: str, x: float) -> None:
            run.world.spawn_robot(name, robot(links), BodyState((x, 2.0, 0.1)))

        add("one", ARM, 0.7)
        assert names(joints=JOINTS, roots={"base"})
        add("two", ARM, 1.7)
        add("three", STIFF["one_link"], 2.5)
        prefixed = [f"two/{joint}" for joint in JOINTS]
        assert names(joints=JOINTS + prefixed, roots={"base", "two/base", "three/base"})
        # What was published as a name is taken as one: it means the first robot, not whichever is alone.
        run.give("joint_commands", JointState(name=["hinge", "two/hinge"], position=[0.4, -0.4]))
        run.run(run.time + 1.0)
        turned = run.received("joint_states")[-1].position
        assert (turned[0], turned[2]) == pytest.approx((0.4, -0.4), abs=0.02)
        run.world.remove("one")
        assert names(joints=prefixed, roots={"two/base", "three/base"})
        add("four", ARM, 0.7)
        assert names(joints=prefixed + JOINTS, roots={"base", "two/base", "three/base"})


def unlike(prefix: str) -> str:
    """The arm with names of its own, as by a prefix of Xacro."""
    text = robot(ARM)
    for word in ("base", "arm", "slider", *JOINTS):
        text = text.replace(f'"{word}"', f'"{prefix}{word}"')
    return text


@given(st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from(["", "left_", "right_"])), min_size=1, max_size=12))
@settings(max_examples=20)
def test_robots_have_the_names_of_their_urdf_where_these_are_distinct(changes: list[tuple[str, str]]) -> None:
    """Robots come, go and are replaced in any order: no name is there twice, none changes, and each takes commands."""
    with World() as world:
        names, kinds, before = RobotNames(world, always=False), dict[str, str](), dict[str, str]()
        for robot_name, kind in changes:
            if kinds.pop(robot_name, None) is not None:
                world.remove(robot_name)
                before.pop(robot_name)
            else:
                world.spawn_robot(robot_name, unlike(kind), BodyState((0.0, 0.0, 1.0)))
                kinds[robot_name] = kind
            prefixes = names.prefixes()
            assert prefixes.keys() == kinds.keys()
            assert prefixes.items() >= before.items()
            short = [kinds[other] for other, prefix in prefixes.items() if not prefix]
            assert len(set(short)) == len(short)
            if robot_name in kinds and robot_name not in before:
                assert bool(prefixes[robot_name]) == (kind in [kinds[other] for other in before if not before[other]])
            joints = [f"{prefix}{kinds[other]}hinge" for other, prefix in prefixes.items()]
            found = joint_commands_from(JointState(name=joints), world, prefixes) if joints else []
            assert [found_robot for found_robot, _, _ in found] == list(prefixes)
            before = dict(prefixes)


NAN = math.nan


def commands(*, always: bool, **fields: Any) -> list[tuple[str, str, JointCommand]]:
    """Those of a message to a robot that is alone."""
    with World() as world:
        world.spawn_robot("one", robot(ARM), BodyState((0.0, 0.0, 1.0)))
        message = JointState(**{"name": JOINTS, **fields})
        return joint_commands_from(message, world, RobotNames(world, always=always).prefixes())


@pytest.mark.parametrize(
    ("fields", "wanted"),
    [
        (
            {"position": [0.5, NAN], "velocity": [NAN, 2.0], "effort": [NAN, NAN]},
            {"hinge": JointCommand(position=0.5), "slide": JointCommand(velocity=2.0)},
        ),
        ({"position": [NAN, NAN], "effort": [1.0, NAN]}, {"hinge": JointCommand(effort=1.0)}),
        ({"velocity": [NAN, 0.0]}, {"slide": JointCommand(velocity=0.0)}),
        ({"position": [NAN, NAN], "velocity": [NAN, NAN]}, {}),
        ({}, {"hinge": JointCommand(), "slide": JointCommand()}),
    ],
)
def test_nan_is_no_command_for_an_interface(fields: Any, wanted: dict[str, JointCommand]) -> None:
    """As ros2_control's topic bridge sends it for mixed robots. Nothing but NaN is no command, not one to be free."""
    assert {joint: command for _, joint, command in commands(always=False, **fields)} == wanted


def test_every_robot_has_a_prefix_by_a_parameter() -> None:
    """One that is alone takes both names in commands. Its frames: test_scene.py."""
    found = commands(always=True, name=["hinge", "one/slide"], position=[0.4, 0.1])
    assert [joint for _, joint, _ in found] == JOINTS
