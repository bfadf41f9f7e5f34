"""Parameters that are lists of YAML mappings: entries that cannot be are refused, with what would be right."""

import pytest

from tests.node.shared import refusal_at_start


@pytest.mark.parametrize(
    ("parameter", "entries", "words"),
    [
        # What all lists have in common.
        ("height_scans", ["robot"], "must be a mapping with body"),
        ("height_scans", ["{layout: isaac_lab}"], "must be a mapping with body"),
        ("height_scans", ["{body: robot"], "is no YAML"),
        ("height_scans", ["{body: null}"], "the name of a body"),
        ("height_scans", ["{body: yes}"], "the name of a body"),
        ("height_scans", ["{body: robot/base}"], "without '/'"),
        ("height_scans", ["{body: robot, rate: 0}"], "rate must be 0.01 to 1000 Hz"),
        ("height_scans", ["{body: robot, rate: .nan}"], "rate must be"),
        ("height_scans", ["{body: a b}", "{body: a_b}"], "two entries for ~/height_scan/a_b"),
        ("imus", ["{body: a, link: b c}", "{body: a, link: b_c}"], "two entries for ~/imu/a/b_c"),
        ("bases", ["{body: a, wheels: [a, b]}", "{body: a, tracks: [c]}"], "two entries for ~/odom/a"),
        ("decks", ["{deck: ferry, frame: a}"] * 2, "two entries"),
        # And what is their own.
        ("height_scans", ["{body: robot, layout: isaac_gym}"], "choose one of ['isaac_lab'"),
        ("ground_maps", ["{body: husky, size: 3}"], "size of a height scan is 3; it must be 2 numbers"),
        ("ground_maps", ["{body: husky, size: [100, 100], spacing: 0.01}"], "there are at most 100000 points"),
        ("imus", ["{body: robot, link: [a]}"], "link must be a text"),
        ("imus", ["{body: robot, gyroscope_bias: [0, 0]}"], "must be three finite numbers"),
        ("bases", ["{body: robot}"], "a base has wheels, with or without steering, or tracks"),
        ("bases", ["{body: robot, wheels: left}"], "it must be a list of different names"),
        ("bases", ["{body: robot, wheels: [a, b], publish_tf: 1}"], "publish_tf must be true or false"),
        ("bases", ["{body: robot, wheels: [a, b], odom_frame: ''}"], "odom_frame must be a text, not empty"),
        ("bases", [f"{{body: {name}, wheels: [a, b], publish_tf: true}}" for name in "ab"], "in one frame"),
        ("bodies.shapes", ["{body: a}"], "it needs a shape and its size, or a urdf"),
        ("bodies.shapes", ["{body: a, urdf: /nowhere.urdf}"], "/nowhere.urdf"),
        ("bodies.spawn", ["{id: x, shape: spere, size: [1], xy: [0, 0]}"], "no shape 'spere'; did you mean 'sphere'?"),
        ("bodies.spawn", ["{id: x, xy: [0, 0]}"], "needs a shape (sphere, box, cylinder, capsule) and its size"),
        ("bodies.spawn", ["{id: x, shape: box, size: [1, 1], xy: [0, 0]}"], "BOX needs 3 dimensions [x, y, z], not 2"),
        ("bodies.spawn", ["{id: x, shape: box, size: 1, xy: [0, 0]}"], "size must be a list of numbers in metres"),
        ("bodies.spawn", ["{id: x, urdf: a, mas: 3, xy: [0, 0]}"], "'mas' is unknown; did you mean 'mass'?"),
        ("bodies.spawn", ["{id: x, urdf: a, mass: [], xy: [0, 0]}"], "mass and yaw must be numbers"),
        ("bodies.spawn", ["{id: x, urdf: a, xy: [0]}"], "xy: [x, y] with clearance or above"),
        ("bodies.spawn", ["{id: x, urdf: a, xyz: [0, 0, 0], align: true}"], "clearance and align go with xy alone"),
        ("decks", ["{deck: ferry}"], "frame, odometry, body"),
        ("decks", ["{deck: ferry, frame: a, body: b}"], "frame, odometry, body"),
        ("decks", ["{deck: ferry, frame: a, link: b}"], "a link is that of a body"),
        ("decks", ["{deck: ferry, odometry: 'no topic'}"], "odometry"),
        ("decks", ["{deck: ferry, frame: a, thickness: -1}"], "thickness"),
        ("decks", ["{deck: ferry, frame: a, rpy: [0, 0, .inf]}"], "rpy must be three finite numbers"),
    ],
)
def test_entries_that_cannot_be_are_refused_at_the_start(parameter: str, entries: list[str], words: str) -> None:
    refusal = refusal_at_start({parameter: entries})
    assert f"{parameter} has" in refusal or "/nowhere.urdf" in refusal
    assert words in refusal
