"""Joint commands from messages, without a node."""

import math
from collections.abc import Iterator
from typing import Any

import pytest
from sensor_msgs.msg import JointState

from smartmesh_ros import BodyState, World
from smartmesh_ros.node.inputs.conversions import RobotNames, joint_commands_from
from smartmesh_ros.world.joints import JointCommand
from tests.node.test_robot_outputs import ARM

NAN = math.nan


@pytest.fixture
def world() -> Iterator[World]:
    with World() as made:
        made.spawn_robot("one", f'<robot name="r">{ARM}</robot>', BodyState((0.0, 0.0, 1.0)))
        yield made


def commands(world: World, **fields: Any) -> list[tuple[str, str, JointCommand]]:
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
    assert {joint: command for _, joint, command in commands(world, **fields)} == wanted
