"""The node takes nothing from its own outputs: else a robot's odometry becomes a tracked body inside that robot."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap

from smartmesh_ros.tools.testing import COLLIDER, Probe
from tests.grid_maps import grid_map_message
from tests.launch_files import LAUNCH, Launch, Recorded, stand_ins
from tests.node.shared import refusal_at_start, spawn
from tests.node.test_presets import own_topics

__all__ = ["stand_ins"]

ROVER = Path(__file__).parents[1] / "data" / "rover.urdf"
# Where the centre of mass of the rover's root link rests on flat ground, and how much higher a test may find it [m].
RESTING, HIGHEST = 0.10, 0.005
# How long the rover is watched, in simulated time [s].
WATCHED = 3.0


def launched(stand_ins: dict[str, type[Recorded]]) -> list[str]:
    """Arguments that elevation_mapping.launch.py starts the collider with."""
    [node] = Launch(LAUNCH / "elevation_mapping.launch.py", stand_ins).of("Node")
    *files, _ = node.kwargs["parameters"]
    remappings = [part for old, new in node.kwargs["remappings"] for part in ("-r", f"{old}:={new}")]
    return ["--ros-args", *(part for file in files for part in ("--params-file", file)), *remappings, "--"]


def flat_map(probe: Probe) -> GridMap:
    """A grid map of flat ground, 6 m a side."""
    return grid_map_message({"elevation": np.zeros((60, 60))}, 0.1, stamp=probe.now())


def test_a_spawned_robot_rests_beside_the_elevation_mapping_set_up(
    probe: Probe, stand_ins: dict[str, type[Recorded]]
) -> None:
    """Under another name than the preset's tracked body. Nobody publishes the odometry of a real robot."""
    folders = {"bodies.urdf_folders": [str(ROVER.parent)]}
    with probe.running(parameters=folders, arguments=launched(stand_ins)) as process:
        assert own_topics(probe) == set()
        maps = probe.publisher(GridMap, "/elevation_mapping/elevation_map")
        states = probe.received[f"{COLLIDER}/body_states"]
        probe.wait_for(lambda: maps.publish(flat_map(probe)) or probe.latest("body_states").header.frame_id)
        spawn(probe, "mine", (0.0, 0.0, RESTING + 0.001), urdf=str(ROVER))
        seen: list[tuple[float, float]] = []  # stamps [s] and heights [m]

        def watched() -> bool:
            maps.publish(flat_map(probe))
            probe.latest("body_states")
            for message in states:
                stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
                seen.extend((stamp, body.pose.position.z) for body in message.bodies if body.id == "mine")
            states.clear()
            return bool(seen) and seen[-1][0] - seen[0][0] > WATCHED

        probe.wait_for(watched, watch=process)
        heights = [height for _, height in seen]
        assert max(heights) < RESTING + HIGHEST
        assert min(heights) > RESTING - HIGHEST


@pytest.mark.parametrize(
    ("parameters", "remap", "words"),
    [
        ({"bodies.odometry": ["husky=~/odometry"]}, [], ("body 'husky'", "'~/odometry'", f"{COLLIDER}/odometry")),
        (
            {"bodies.odometry": ["husky=~/tracked_odometry"]},
            ["~/tracked_odometry:=/odom", "~/odometry:=/odom"],
            ("body 'husky'", "'~/tracked_odometry'", "/odom", "publishes as ~/odometry"),
        ),
        ({"bodies.poses": [f"x={COLLIDER}/body_states"]}, [], ("body 'x'", "publishes as ~/body_states")),
        ({}, ["~/tracked_bodies:=/bodies", "~/body_states:=/bodies"], ("~/tracked_bodies", "/bodies", "~/body_states")),
        ({}, ["~/joint_commands:=~/joint_states"], ("~/joint_commands", "publishes as ~/joint_states")),
    ],
)
def test_an_input_on_a_topic_that_the_node_publishes_is_refused_with_both_named(
    domain: int, parameters: dict[str, Any], remap: list[str], words: tuple[str, ...]
) -> None:
    reason = refusal_at_start(parameters, [part for rule in remap for part in ("-r", rule)])
    assert all(word in reason for word in words), reason
