"""Parameters that are lists of YAML mappings: entries that cannot be are refused, with what would be right."""

import pytest

from smartmesh_ros import Cylinder
from smartmesh_ros.node.services.body_entries import entries_from
from tests.node.shared import refusal_at_start


def test_dimensions_have_the_order_of_the_messages() -> None:
    entries = entries_from(["{id: can, shape: cylinder, size: [0.8, 0.25], xy: [0, 0]}"])
    assert entries["can"].shape == Cylinder(height=0.8, radius=0.25)


@pytest.mark.parametrize(
    ("parameter", "entries", "words"),
    [
        # What all lists have in common.
        ("height_scans", ["robot"], "must be a mapping with body"),
        ("height_scans", ["{layout: isaac_lab}"], "must be a mapping with body"),
        ("height_scans", ["{body: robot, height: 2}"], "must be a mapping with body and any of"),
        ("height_scans", ["{body: robot"], "is no YAML"),
        ("height_scans", ["{body: 2024-13-45}"], "is no YAML"),
        ("height_scans", ["{body: null}"], "the name of a body"),
        ("height_scans", ["{body: [robot]}"], "the name of a body"),
        ("height_scans", ["{body: yes}"], "the name of a body"),
        ("height_scans", ["{body: ''}"], "not empty"),
        ("height_scans", ["{body: robot/base}"], "without '/'"),
        ("height_scans", ["{body: robot, rate: 0}"], "rate must be 0.01 to 1000 Hz"),
        ("height_scans", ["{body: robot, rate: fast}"], "rate must be"),
        ("height_scans", ["{body: robot, rate: .nan}"], "rate must be"),
        ("height_scans", ["{body: a b}", "{body: a_b}"], "two entries for ~/height_scan/a_b"),
        ("imus", ["{body: a, link: b c}", "{body: a, link: b_c}"], "two entries for ~/imu/a/b_c"),
        ("bases", ["{body: a, wheels: [a, b]}", "{body: a, tracks: [c]}"], "two entries for ~/odom/a"),
        ("decks", ["{deck: ferry, frame: a}"] * 2, "two entries"),
        # And what is their own.
        ("height_scans", ["{body: robot, layout: isaac_gym}"], "choose one of ['isaac_lab'"),
        ("height_scans", ["{body: robot, noise: -1}"], "noise of a height scan is -1.0; it must be 0 to 1000 m"),
        ("ground_maps", ["{body: husky, size: 3}"], "size of a height scan is 3; it must be 2 numbers"),
        ("ground_maps", ["{body: husky, size: [100, 100], spacing: 0.01}"], "there are at most 100000 points"),
        ("imus", ["{body: robot, link: [a]}"], "link must be a text"),
        ("imus", ["{body: robot, rate: 0}"], "rate of an IMU is 0; it must be 0.01 to 10000 Hz"),
        ("imus", ["{body: robot, gyroscope_bias: [0, 0]}"], "must be three finite numbers"),
        ("bases", ["{body: robot}"], "a base has wheels, with or without steering, or tracks"),
        ("bases", ["{body: robot, wheels: left}"], "it must be a list of different names"),
        ("bases", ["{body: robot, wheels: [a, b], radius: -1}"], "radius of a base is -1"),
        ("bases", ["{body: robot, wheels: [a, b], publish_tf: 1}"], "publish_tf must be true or false"),
        ("bases", ["{body: robot, wheels: [a, b], odom_frame: ''}"], "odom_frame must be a text, not empty"),
        ("bases", [f"{{body: {name}, wheels: [a, b], publish_tf: true}}" for name in "ab"], "in one frame"),
        ("bodies.shapes", ["{body: a}"], "it needs a shape and its size, or a urdf"),
        ("bodies.shapes", ["{body: a, urdf: /nowhere.urdf}"], "/nowhere.urdf"),
        ("bodies.spawn", ["{id: x, shape: spere, size: [1], xy: [0, 0]}"], "no shape 'spere'; did you mean 'sphere'?"),
        ("bodies.spawn", ["{id: x, shape: [0.2], xy: [0, 0]}"], "[0.2]; choose sphere, box, cylinder, capsule"),
        ("bodies.spawn", ["{id: x, xy: [0, 0]}"], "needs a shape (sphere, box, cylinder, capsule) and its size"),
        ("bodies.spawn", ["{id: x, shape: box, size: [1, 1], xy: [0, 0]}"], "BOX needs 3 dimensions [x, y, z], not 2"),
        ("bodies.spawn", ["{id: x, shape: box, size: 1, xy: [0, 0]}"], "size must be a list of numbers in metres"),
        ("bodies.spawn", ["{id: x, shape: sphere, size: [-1], xy: [0, 0]}"], "radius of the sphere is -1.0 m"),
        ("bodies.spawn", ["{id: x, urdf: a, mas: 3, xy: [0, 0]}"], "'mas' is unknown; did you mean 'mass'?"),
        ("bodies.spawn", ["{id: x, urdf: a, mass: [], xy: [0, 0]}"], "mass and yaw must be numbers"),
        ("bodies.spawn", ["{id: x, urdf: a, xy: [0]}"], "xy: [x, y] with clearance or above"),
        ("bodies.spawn", ["{id: x, urdf: a, xyz: [0, 0, 0], align: true}"], "clearance and align go with xy alone"),
        ("decks", ["{deck: ferry}"], "frame, odometry, body"),
        ("decks", ["{deck: ferry, frame: a, body: b}"], "frame, odometry, body"),
        ("decks", ["{deck: a/b, frame: a}"], "without '/'"),
        ("decks", ["{deck: ferry, frame: a, link: b}"], "a link is that of a body"),
        ("decks", ["{deck: ferry, odometry: 'no topic'}"], "odometry"),
        ("decks", ["{deck: ferry, frame: a, thickness: -1}"], "thickness"),
        ("decks", ["{deck: ferry, frame: a, at: [0, 0]}"], "at must be three numbers"),
        ("decks", ["{deck: ferry, frame: a, rpy: [0, 0, .inf]}"], "rpy must be three finite numbers"),
    ],
)
def test_entries_that_cannot_be_are_refused_at_the_start(
    domain: int, parameter: str, entries: list[str], words: str
) -> None:
    refusal = refusal_at_start({parameter: entries})
    assert f"{parameter} has" in refusal or "/nowhere.urdf" in refusal
    assert words in refusal
