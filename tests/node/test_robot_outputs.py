"""Names and outputs of robots: of those of one link as of others, under names that stay, and commands by these; frames
on ``/tf``: of simulated bodies and robots, and never of others."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import JointState
from simulation_interfaces import srv
from simulation_interfaces.msg import Result
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Sphere, World
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.conversions import RobotNames, joint_commands_from
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.world.joints import JointCommand
from tests.node.shared import on_level
from tests.urdfs import joint, link, robot

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


def test_robots_that_cannot_move_their_links_are_published() -> None:
    topics = ("body_descriptions", "joint_states", "contact_wrenches", "odometry", "patches", "collider_patches")
    with on_level({"simulation_interfaces": True}, keep=topics) as run:
        for place, (kind, links) in enumerate(STIFF.items()):
            run.world.spawn_robot(kind, robot(links), BodyState((0.5 + place, 2.0, 0.1)))
        run.run(1.0)
        described, joints, wrenches, *_ = (run.received(topic)[-1] for topic in topics)
        assert {body.id for body in described.bodies} == STIFF.keys()
        assert (list(joints.name), list(joints.position)) == ([], [])
        places = {wrench.body_id: wrench.centre.z for wrench in wrenches.wrenches}
        assert places.keys() == {f"{kind}/base" for kind in STIFF} and np.isfinite([*places.values()]).all()
        services = {"state": srv.GetEntityState, "info": srv.GetEntityInfo, "bounds": srv.GetEntityBounds}
        for kind, (what, service) in product(STIFF, services.items()):
            answer = run.call(f"get_entity_{what}", service.Request(entity=kind))
            assert answer.result.result == Result.RESULT_OK


ARM = (
    BASE
    + link("arm", "", 0.1, 0.1)
    + joint("hinge", "continuous", "base", "arm", '<limit effort="5" velocity="50"/>', "0.1 0.2 0.3", "0 0 1")
    + link("slider", "", 0.1, 0.1)
    + joint("slide", "prismatic", "arm", "slider", LIMIT, "0 0 0", "1 0 0")
)
JOINTS = ["hinge", "slide"]


def unlike(prefix: str) -> str:
    """The arm with names of its own, as by a prefix of Xacro, but for a fixed joint, which no message names."""
    text = robot(ARM + link("lidar", "", None) + joint("mount", "fixed", "base", "lidar"))
    for word in ("base", "arm", "slider", "lidar", *JOINTS):
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


def buffer_of(*messages: TFMessage) -> FrameBuffer:
    """All frames of some messages."""
    buffer = FrameBuffer()
    for item in (item for message in messages for item in message.transforms):
        t, q = item.transform.translation, item.transform.rotation
        pose = Transform((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))
        buffer.add(item.header.frame_id, item.child_frame_id, pose, None)
    return buffer


def test_a_link_that_is_named_like_a_body_has_the_prefix_of_its_robot() -> None:
    with on_level({"publish.tf": 50.0}, keep=["/tf"]) as run:
        run.world.spawn("base", Sphere(0.2), 1.0, BodyState((2.0, 1.0, 0.5)))
        run.world.spawn_robot("robot", robot(ARM), BodyState((0.7, 2.0, 0.1)))
        run.run(2.0)
        frames = run.received("/tf")[-1].transforms
        assert {frame.child_frame_id: frame.header.frame_id for frame in frames} == {
            "base": "map", "robot/base": "map", "robot/arm": "robot/base", "robot/slider": "robot/arm",
            "robot": "robot/base",
        }  # fmt: skip


def test_names_stay_whatever_robots_come_and_go_and_frames_are_where_bodies_and_links_are() -> None:
    with on_level({"publish.tf": 50.0}, keep=["/tf", "joint_states", "odometry"]) as run:

        def add(name: str, links: str, x: float) -> None:
            run.world.spawn_robot(name, robot(links), BodyState((x, 2.0, 0.1)))

        def require(joints: list[str], frames: dict[str, str]) -> FrameBuffer:
            """Names of joints; frames and their parents, each once, where the odometry says."""
            run.run(run.time + 1.5)
            message, poses = run.received("/tf")[-1], run.received("odometry")
            assert list(run.received("joint_states")[-1].name) == joints
            assert {item.child_frame_id: item.header.frame_id for item in message.transforms} == frames
            assert len(message.transforms) == len(frames)
            roots = {one.child_frame_id: one for one in poses if one.header.stamp == poses[-1].header.stamp}
            assert roots.keys() == {name for name in frames if frames[name] == "map"} - run.world.bodies.keys()
            for name, root in roots.items():
                place = root.pose.pose.position
                found, _ = buffer_of(message).lookup("map", name)
                assert found.translation == pytest.approx((place.x, place.y, place.z), abs=1e-3)
            return buffer_of(message)

        run.world.track("tracked", 0.3, BodyState((1.0, 1.0, 0.3)))
        run.world.spawn("ball", Sphere(0.2), 1.0, BodyState((2.0, 1.0, 0.5)))
        add("one", ARM, 0.7)
        wanted = {"ball": "map", "base": "map", "arm": "base", "slider": "arm", "one": "base"}
        require(JOINTS, wanted)
        add("two", ARM, 1.7)
        add("stiff", STIFF["fixed_links"], 2.5)
        more = {"two/base": "map", "two/arm": "two/base", "two/slider": "two/arm", "two": "two/base"}
        more |= {"stiff/base": "map", "stiff/lidar": "stiff/base", "stiff": "stiff/base"}
        prefixed = [f"two/{joint}" for joint in JOINTS]
        # What was published as a name is taken as one: it means the first robot, not whichever is alone.
        run.give("joint_commands", JointState(name=["hinge", "slide", "two/hinge"], position=[0.5, 0.2, -0.4]))
        buffer = require(JOINTS + prefixed, wanted | more)
        turn, shift, other, _ = run.received("joint_states")[-1].position
        assert (turn, shift, other) == pytest.approx((0.5, 0.2, -0.4), abs=0.02)
        there = (0.1 + np.cos(turn) * shift, 0.2 + np.sin(turn) * shift, 0.3)
        assert buffer.lookup("base", "slider")[0].translation == pytest.approx(there, abs=1e-3)
        run.world.remove("one")
        require(prefixed, {"ball": "map"} | more)
        # No frame has two parents: of a body that is called as a link of the robot without prefix.
        add("slider", ARM.replace('"arm"', '"leaf"').replace('"base"', '"stem"'), 0.7)
        run.world.spawn("leaf", Sphere(0.2), 1.0, BodyState((2.0, 1.5, 0.5)))
        require(prefixed + JOINTS, {"ball": "map", "stem": "map", "leaf": "stem", "slider": "leaf"} | more)


def test_frames_of_others_are_left_to_them() -> None:
    """Of a robot_state_publisher, of a localisation, and above the map."""
    links = ARM.replace('"base"', '"trunk"').replace('"arm"', '"limb"').replace('"slider"', '"hand"')
    with on_level({"publish.tf": 50.0}, keep=["/tf"]) as run:

        def parents(seconds: float = 0.5) -> dict[str, str]:
            """Parents by frame, so much later."""
            run.run(run.time + seconds)
            return {item.child_frame_id: item.header.frame_id for item in run.received("/tf")[-1].transforms}

        def send(topic: str, *frames: tuple[str, str]) -> None:
            items = [TransformStamped(header=Header(frame_id=above), child_frame_id=child) for above, child in frames]
            run.give(topic, TFMessage(transforms=items))

        run.world.spawn_robot("one", robot(links), BodyState((0.7, 2.0, 0.1)))
        assert parents(2.0) == {"trunk": "map", "limb": "trunk", "hand": "limb", "one": "trunk"}
        send("/tf_static", ("trunk", "limb"))
        assert parents() == {"trunk": "map", "hand": "limb", "one": "trunk"}
        send("/tf", ("earth", "map"), ("odom", "/trunk"))
        assert parents() == {"hand": "limb", "one": "trunk"}
        # A body that is called as a frame above the terrain's would make a loop of the tree.
        for name in ("earth", "map", "ball"):
            run.world.spawn(name, Sphere(0.2), 1.0, BodyState((2.0, 1.0, 0.5)))
        assert parents() == {"hand": "limb", "one": "trunk", "ball": "map"}
        assert parents(5.0)["trunk"] == "map", "nobody publishes it any more"


def test_without_a_rate_there_is_no_publisher_of_frames() -> None:
    with on_level({"publish.tf": 50.0}, keep=["/tf"]) as run:
        run.world.spawn_robot("stiff", robot(STIFF["one_link"]), BodyState((2.0, 2.0, 0.1)))
        for rate in (50.0, 0.0, 50.0):
            run.set(publish__tf=rate)
            before = len(run.received("/tf"))
            run.run(run.time + 2.0)
            assert ("/tf" in run.node.publishers) == (len(run.received("/tf")) > before) == bool(rate)
