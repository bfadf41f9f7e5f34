"""Robots under the topics of topic_based_ros2_control, whose part the test plays by the example of the page."""

from __future__ import annotations

import math
import re
import shlex
from typing import Any
from xml.etree import ElementTree

from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from smartmesh_ros.tools.testing import Probe, Process
from tests.node.shared import LATCHED
from tests.node.test_real_maps import LEVEL
from tests.node.test_tutorial import blocks
from tests.urdfs import joint, link, robot

LIMIT = '<limit lower="{}" upper="{}" effort="50" velocity="50"/>'
PARTS = [
    link("base", '<box size="0.6 0.6 0.2"/>', moment=0.1),
    link("arm", "", moment=0.1),
    link("reel", "", moment=0.1),
    joint("shoulder", "revolute", "base", "arm", LIMIT.format("-2", "2"), "0 0 0", "0 0 1"),
    joint("wheel", "continuous", "base", "reel", LIMIT.format("0", "0"), "0 0 0", "0 0 1"),
]
FIELDS = ("position", "velocity", "effort")


class Hardware:
    """A `<ros2_control>` block: sends the commands of its joints, and takes their states by name.

    An array has the numbers of those joints alone that have the interface, in the order of the block.
    """

    def __init__(self, probe: Probe, block: str) -> None:
        self._probe, system = probe, ElementTree.fromstring(block)
        self._commands = [
            (joint.attrib["name"], interface.attrib["name"])
            for joint in system.iterfind("joint")
            for interface in joint.iterfind("command_interface")
        ]
        self.commands = dict.fromkeys(self._commands, math.nan)
        self.states: dict[tuple[str, str], float] = {}
        parameters = {item.attrib["name"]: item.text or "" for item in system.iterfind("hardware/param")}
        probe.node.create_subscription(
            JointState, parameters["joint_states_topic"], self._read, qos_profile_sensor_data
        )
        self._publisher = probe.node.create_publisher(
            JointState, parameters["joint_commands_topic"], QoSProfile(depth=1)
        )

    def _read(self, message: JointState) -> None:
        for index, name in enumerate(message.name):
            for field in FIELDS:
                self.states[name, field] = getattr(message, field)[index]

    def write(self) -> None:
        """Sends all commands, whether or not a controller has set them."""
        message = JointState(name=list(dict.fromkeys(name for name, _ in self._commands)))
        message.header.stamp = self._probe.now()
        for name, interface in self._commands:
            getattr(message, interface).append(self.commands[name, interface])
        self._publisher.publish(message)


def test_two_blocks_drive_a_robot_on_the_topics_of_the_page(probe: Probe) -> None:
    [arm] = [block for block in blocks("docs/robots.md", "xml") if "TopicBasedSystem" in block]
    [command] = [block for block in blocks("docs/robots.md", "console") if "topic_based" in block]
    wheels = arm.replace("shoulder", "wheel").replace(
        'command_interface name="position"', 'command_interface name="velocity"'
    )
    described = robot(*PARTS, arm, wheels)
    words = shlex.split(command.replace("\\\n", " "))
    arguments = [*words[4:], "-p", "robot.above:=0.11", "-p", "robot.xy:=[5.0, 5.0]"]
    with Process("terrain_collider", arguments=arguments) as process:
        hardware = [Hardware(probe, arm), Hardware(probe, wheels)]
        probe.wait_for(probe.connected, watch=process)
        probe.publish_map(LEVEL, resolution=0.5)
        probe.publisher(String, "/robot_description", LATCHED).publish(String(data=described))

        def holds(**wanted: float) -> Any:
            """Whether positions of the shoulder and velocities of the wheel are so, while both blocks send."""

            def found() -> bool:
                for block in hardware:
                    block.write()
                states = hardware[0].states | hardware[1].states
                near = (
                    abs(states.get(tuple(key.split("_")), math.inf) - value) < 0.02 for key, value in wanted.items()
                )
                return all(near)

            return found

        probe.wait_for(lambda: all(block.states for block in hardware), watch=process)
        probe.wait_for(holds(shoulder_position=0.0, wheel_velocity=0.0), watch=process)  # nothing but NaN
        hardware[0].commands["shoulder", "position"] = 0.7
        probe.wait_for(holds(shoulder_position=0.7, wheel_velocity=0.0), watch=process)
        hardware[1].commands["wheel", "velocity"] = 3.0
        probe.wait_for(holds(shoulder_position=0.7, wheel_velocity=3.0), watch=process)
        assert probe.diagnostics("inputs")["message"] == "0 refused so far"
        one = Hardware(probe, re.sub(r"</ros2_control>$", "", arm.strip()) + wheels[wheels.index("<joint") :])

        def refused() -> bool:
            one.write()  # the first commands of a new publisher may be lost
            return "refused, joint_commands: length" in probe.diagnostics("inputs")

        probe.wait_for(refused, watch=process)
