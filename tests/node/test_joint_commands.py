"""Joint commands from messages, without a node."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from smartmesh_ros import BodyState, HeightMap, InputError, World
from smartmesh_ros.node.inputs.joint_commands import CommandedJoint, RobotNames, joint_commands_from
from smartmesh_ros.scenes.tracks import robot_file
from smartmesh_ros.world.joints import JointCommand
from tests.node.test_robot_outputs import ARM

NAN = math.nan


@pytest.fixture
def world() -> Iterator[World]:
    with World() as made:
        made.spawn_robot("one", f'<robot name="r">{ARM}</robot>', BodyState((0.0, 0.0, 1.0)))
        yield made


def commands(world: World, **fields: Any) -> list[CommandedJoint]:
    message = JointState(**{"name": ["hinge", "slide"], **fields})
    return joint_commands_from(message, world, RobotNames(world, always=False).prefixes())


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
def test_nan_is_no_command_for_an_interface(world: World, fields: Any, wanted: dict[str, JointCommand]) -> None:
    """As ros2_control's topic bridge sends it for mixed robots. Nothing but NaN is no command, not one to be free."""
    assert {found.joint: found.command for found in commands(world, **fields)} == wanted


TRACKS = ["left_track", "right_track"]


@pytest.fixture(scope="module")
def tracked() -> Iterator[World]:
    """Two tracked machines on level ground, of which the first has short names."""
    with World(HeightMap(np.zeros((101, 101)), resolution=0.1, origin=(-5.0, -5.0))) as made:
        for name, y in (("one", -2.0), ("two", 2.0)):
            made.spawn_robot(name, str(robot_file()), BodyState((0.0, y, 0.0)), on_ground=True)
        yield made


def apply(world: World, **fields: Any) -> None:
    for robot, joint, command in commands(world, **fields):
        world.command(robot, joint, command)


def speeds(world: World, robot: str) -> list[float]:
    return [surface.speed for surface in world.surfaces(robot)]


@pytest.mark.parametrize(
    ("fields", "reason", "words"),
    [
        ({"name": ["left_track", "middle_track"], "velocity": [1.0, 1.0]}, "unknown_joint", "one/left_track"),
        ({"name": TRACKS, "velocity": [1.0, math.inf]}, "non_finite", "finite"),
        ({"name": TRACKS, "velocity": [1.0, NAN], "position": [NAN, 1.0]}, "joint_command", "velocity alone"),
        ({"name": TRACKS, "velocity": [1.0, 1.0], "effort": [NAN, 1.0]}, "joint_command", "velocity alone"),
        ({"name": TRACKS}, "joint_command", "velocity alone"),
        ({"name": ["left_track", "one/left_track"], "velocity": [1.0, 1.0]}, "duplicate_id", "once"),
    ],
)
def test_what_is_no_command_to_a_track_is_refused_as_a_whole(
    tracked: World, fields: Any, reason: str, words: str
) -> None:
    before = speeds(tracked, "one")
    with pytest.raises(InputError, match=words) as caught:
        apply(tracked, **fields)
    assert caught.value.reason == reason
    assert speeds(tracked, "one") == before
