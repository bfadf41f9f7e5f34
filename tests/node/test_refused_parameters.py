"""Parameters that cannot be are refused at the start, with what would be right."""

from typing import Any

import pytest

from smartmesh_ros.tools.testing import COLLIDER
from tests.node.shared import refusal_at_start

MAPS = f"qos_overrides.{COLLIDER}/heightmap.subscription"

UNNAMED = ("physics.gravity", "raster.origin", "soil.type")  # they are told by other words


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"physics.rate": "fast"}, "physics.rate"),
        ({"terrain.motion": "jelly"}, "terrain.motion"),
        ({"physics.gravity": [0.0, 1.0]}, "gravity"),
        ({"physics.gravity": [0, 0, -9.81]}, "of the same type, so write [0.0, 0.0, -9.81]"),
        ({"use_sim_time": 3}, "use_sim_time"),
        ({"publish.clock": 10.0, "use_sim_time": True}, "use_sim_time"),
        ({"bodies.poses": ["rover=/a b"]}, "rover=/a b"),
        ({"bodies.odometry": ["a=/b"], "bodies.poses": ["/a"]}, "names body 'a' again"),
        ({"bodies.odometry": ["x/y=/b"]}, "no '/' in the name"),
        ({"bodies.peers": ["auto", "/a"]}, "alone"),
        ({"bodies.peers": ["a"]}, "starts with '/'"),
        ({"terrain.input": "lidar"}, "choose one of heightmap, grid_map"),
        ({"terrain.file": "/nowhere/map.npy"}, "there is no file /nowhere/map.npy"),
        ({"raster.origin": [0.0, 0.0]}, "three finite numbers"),
        ({"soil.type": ["lunar", "porridge"]}, "there is no soil 'porridge'"),
        ({"soil.type": ["lunar"], "terrain.changes": "correction"}, "terrain.changes"),
        # Quality of service.
        ({f"{MAPS}.reliability": "often"}, "reliable, best_effort"),
        ({f"{MAPS}.durability": ""}, "transient_local"),
        ({f"{MAPS}.history": True}, "keep_last, keep_all"),
        ({f"{MAPS}.depth": 0}, "1 to"),
        ({f"{MAPS}.depth": 2**40}, "1 to"),
        ({f"{MAPS}.depth": "ten"}, "1 to"),
        ({f"{MAPS}.speed": 5}, "history, depth, reliability, durability"),
        ({f"qos_overrides.{COLLIDER}/heightmap.subscriber.depth": 5}, "publisher or subscription"),
        ({"qos_overrides.terrain_collider/heightmap.subscription.depth": 5}, "full name"),
        ({"qos_overrides.depth": 5}, "qos_overrides.<topic>"),
        # Lists of YAML mappings: what all have in common.
        ({"height_scans": ["robot"]}, "must be a mapping with body"),
        ({"height_scans": ["{layout: isaac_lab}"]}, "must be a mapping with body"),
        ({"height_scans": ["{body: robot"]}, "is no YAML"),
        ({"height_scans": ["{body: null}"]}, "the name of a body"),
        ({"height_scans": ["{body: yes}"]}, "the name of a body"),
        ({"height_scans": ["{body: robot/base}"]}, "without '/'"),
        ({"height_scans": ["{body: robot, rate: 0}"]}, "rate must be 0.01 to 1000 Hz"),
        ({"height_scans": ["{body: robot, rate: .nan}"]}, "rate must be"),
        ({"height_scans": ["{body: a b}", "{body: a_b}"]}, "two entries for ~/height_scan/a_b"),
        ({"imus": ["{body: a, link: b c}", "{body: a, link: b_c}"]}, "two entries for ~/imu/a/b_c"),
        ({"bases": ["{body: a, wheels: [a, b]}", "{body: a, tracks: [c]}"]}, "two entries for ~/odom/a"),
        ({"decks": ["{deck: ferry, frame: a}"] * 2}, "two entries"),
        # And what is their own.
        ({"height_scans": ["{body: robot, layout: isaac_gym}"]}, "choose one of ['isaac_lab'"),
        ({"ground_maps": ["{body: husky, size: 3}"]}, "size of a height scan is 3; it must be 2 numbers"),
        ({"ground_maps": ["{body: husky, size: [100, 100], spacing: 0.01}"]}, "there are at most 100000 points"),
        ({"imus": ["{body: robot, link: [a]}"]}, "link must be a text"),
        ({"imus": ["{body: robot, gyroscope_bias: [0, 0]}"]}, "must be three finite numbers"),
        ({"bases": ["{body: robot}"]}, "a base has wheels, with or without steering, or tracks"),
        ({"bases": ["{body: robot, wheels: left}"]}, "it must be a list of different names"),
        ({"bases": ["{body: robot, wheels: [a, b], publish_tf: 1}"]}, "publish_tf must be true or false"),
        ({"bases": ["{body: robot, wheels: [a, b], odom_frame: ''}"]}, "odom_frame must be a text, not empty"),
        ({"bases": [f"{{body: {name}, wheels: [a, b], publish_tf: true}}" for name in "ab"]}, "in one frame"),
        ({"bodies.shapes": ["{body: a}"]}, "it needs a shape and its size, or a urdf"),
        ({"bodies.shapes": ["{body: a, urdf: /nowhere.urdf}"]}, "/nowhere.urdf"),
        ({"bodies.spawn": ["{id: x, shape: spere, size: [1], xy: [0, 0]}"]}, "no shape 'spere'; did you mean 'sphere'"),
        ({"bodies.spawn": ["{id: x, xy: [0, 0]}"]}, "needs a shape (sphere, box, cylinder, capsule) and its size"),
        ({"bodies.spawn": ["{id: x, shape: box, size: [1, 1], xy: [0, 0]}"]}, "BOX needs 3 dimensions [x, y, z], not"),
        ({"bodies.spawn": ["{id: x, shape: box, size: 1, xy: [0, 0]}"]}, "size must be a list of numbers in metres"),
        ({"bodies.spawn": ["{id: x, urdf: a, mas: 3, xy: [0, 0]}"]}, "'mas' is unknown; did you mean 'mass'?"),
        ({"bodies.spawn": ["{id: x, urdf: a, mass: [], xy: [0, 0]}"]}, "mass and yaw must be numbers"),
        ({"bodies.spawn": ["{id: x, urdf: a, xy: [0]}"]}, "xy: [x, y] with clearance or above"),
        ({"bodies.spawn": ["{id: x, urdf: a, xyz: [0, 0, 0], align: true}"]}, "clearance and align go with xy alone"),
        ({"decks": ["{deck: ferry}"]}, "frame, odometry, body"),
        ({"decks": ["{deck: ferry, frame: a, body: b}"]}, "frame, odometry, body"),
        ({"decks": ["{deck: ferry, frame: a, link: b}"]}, "a link is that of a body"),
        ({"decks": ["{deck: ferry, odometry: 'no topic'}"]}, "odometry"),
        ({"decks": ["{deck: ferry, frame: a, thickness: -1}"]}, "thickness"),
        ({"decks": ["{deck: ferry, frame: a, rpy: [0, 0, .inf]}"]}, "rpy must be three finite numbers"),
    ],
)
def test_what_cannot_be_is_refused_at_the_start(parameters: dict[str, Any], words: str) -> None:
    refusal = refusal_at_start(parameters)
    name, *_ = parameters
    assert words in refusal and (name in refusal or name in UNNAMED or "/nowhere" in refusal)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"publish.tf": 10.0}, "publish.tf needs tf2_msgs/TFMessage"),
        ({"bodies.frames": ["base_link"]}, "needs tf2_msgs/TFMessage"),
        ({"terrain.input": "grid_map"}, "needs grid_map_msgs/GridMap"),
    ],
)
def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, parameters: dict[str, Any], words: str) -> None:
    monkeypatch.setattr("smartmesh_ros.node.inputs.optional_messages.find_interfaces", lambda *_: None)
    said, package = refusal_at_start(parameters), words.split()[-1].partition("/")[0].replace("_", "-")
    assert words in said and f"apt install ros-jazzy-{package}" in said


@pytest.mark.parametrize(
    ("parameters", "remap", "words"),
    [
        ({"bodies.odometry": ["husky=~/odometry"]}, [], ("body 'husky'", "'~/odometry'", f"{COLLIDER}/odometry")),
        (
            {"bodies.odometry": ["husky=~/tracked_odometry"]},
            ["~/tracked_odometry:=/odom", "~/odometry:=/odom"],
            ("body 'husky'", "'~/tracked_odometry'", "/odom", "publishes as ~/odometry"),
        ),
        ({}, ["~/tracked_bodies:=/bodies", "~/body_states:=/bodies"], ("~/tracked_bodies", "/bodies", "~/body_states")),
        ({}, ["~/joint_commands:=~/joint_states"], ("~/joint_commands", "publishes as ~/joint_states")),
    ],
)
def test_an_input_on_a_topic_that_the_node_publishes_is_refused_with_both_named(
    parameters: dict[str, Any], remap: list[str], words: tuple[str, ...]
) -> None:
    reason = refusal_at_start(parameters, [part for rule in remap for part in ("-r", rule)])
    assert all(word in reason for word in words), reason
