"""Parameters that are lists of YAML mappings: what cannot be is refused at the start."""

import pytest

from tests.node.shared import refusal_at_start


@pytest.mark.parametrize(
    ("parameter", "entries", "words"),
    [
        ("height_scans", ["robot"], "must be a mapping with body"),
        ("height_scans", ["{layout: isaac_lab}"], "must be a mapping with body"),
        ("height_scans", ["{body: robot"], "is no YAML"),
        ("height_scans", ["{body: 2024-13-45}"], "is no YAML"),
        ("height_scans", ["{body: null}"], "the name of a body"),
        ("height_scans", ["{body: ''}"], "not empty"),
        ("height_scans", ["{body: robot/base}"], "without '/'"),
        ("height_scans", ["{body: robot, layout: isaac_gym}"], "choose one of ['isaac_lab'"),
        ("height_scans", ["{body: robot, rate: 0}"], "rate must be 0.01 to 1000 Hz"),
        ("height_scans", ["{body: robot, rate: fast}"], "rate must be"),
        ("height_scans", ["{body: robot, rate: .nan}"], "rate must be"),
        ("height_scans", ["{body: robot, noise: -1}"], "noise of a height scan is -1.0; it must be 0 to 1000 m"),
        ("height_scans", ["{body: a b}", "{body: a_b}"], "two entries for ~/height_scan/a_b"),
        ("ground_maps", ["{body: husky, layers: [elevation]}"], "a mapping with body and any of ['rate', 'size'"),
        ("ground_maps", ["{body: husky, size: 3}"], "size of a height scan is 3; it must be 2 numbers"),
        ("imus", ["{body: robot, position: [0, 0, 1]}"], "must be a mapping with body and any of ['link', 'rate'"),
        ("imus", ["{body: robot, link: [a]}"], "link must be a text"),
        ("imus", ["{body: robot, rate: 0}"], "rate of an IMU is 0; it must be 0.01 to 10000 Hz"),
        ("imus", ["{body: robot, gyroscope_bias: [0, 0]}"], "must be three finite numbers"),
        ("imus", ["{body: a, link: b c}", "{body: a, link: b_c}"], "two entries for ~/imu/a/b_c"),
        ("bases", ["{body: robot}"], "a base has wheels, with or without steering, or tracks"),
        ("bases", ["{body: robot, wheels: left}"], "it must be a list of different names"),
        ("bases", ["{body: robot, wheels: [a, b], radius: -1}"], "radius of a base is -1"),
        ("bases", ["{body: robot, wheels: [a, b], publish_tf: 1}"], "publish_tf must be true or false"),
        ("bases", ["{body: robot, wheels: [a, b], odom_frame: ''}"], "odom_frame must be a text, not empty"),
        ("bases", [f"{{body: {name}, wheels: [a, b], publish_tf: true}}" for name in "ab"], "in one frame"),
        ("bodies.shapes", ["{body: a}"], "it needs a shape and its size, or a urdf"),
        ("bodies.shapes", ["{body: a, shape: cone, size: [1]}"], "there is no shape 'cone'; choose sphere, box, "),
        ("bodies.shapes", ["{body: a, shape: box, size: 1}"], "size must be a list of numbers"),
        ("bodies.shapes", ["{body: a, shape: box, size: [1, 2]}"], "BOX needs 3 dimensions [x, y, z], not 2"),
        ("bodies.shapes", [f"{{body: a, shape: sphere, size: [{size}]}}" for size in "12"], "two entries for a"),
        ("bodies.shapes", ["{body: a, urdf: /nowhere.urdf}"], "/nowhere.urdf"),
        ("decks", ["{deck: ferry}"], "frame, odometry, body"),
        ("decks", ["{deck: ferry, frame: a, body: b}"], "frame, odometry, body"),
        ("decks", ["{deck: a/b, frame: a}"], "without '/'"),
        ("decks", ["{deck: ferry, frame: a, link: b}"], "a link is that of a body"),
        ("decks", ["{deck: ferry, odometry: 'no topic'}"], "odometry"),
        ("decks", ["{deck: ferry, frame: a, thickness: -1}"], "thickness"),
        ("decks", ["{deck: ferry, frame: a, at: [0, 0]}"], "at must be three numbers"),
        ("decks", ["{deck: ferry, frame: a, rpy: [0, 0, .inf]}"], "rpy must be three finite numbers"),
        ("bodies.spawn", ["{id: x, shape: spere, size: [0.2]}"], "no shape 'spere'; did you mean 'sphere'?"),
        ("bodies.spawn", ["{id: x, shape: [0.2]}"], "no shape [0.2]; choose sphere, box, cylinder, capsule"),
        ("bodies.spawn", ["{id: x}"], "needs a shape (sphere, box, cylinder, capsule) and its size, or a urdf"),
        ("bodies.spawn", ["{id: x, shape: box, size: [1, 1]}"], "BOX needs 3 dimensions [x, y, z], not 2"),
        ("bodies.spawn", ["{id: x, shape: box, size: 1}"], "needs the size of its shape in metres"),
        ("bodies.spawn", ["{id: x, shape: sphere, size: [-1]}"], "radius of the sphere is -1.0 m"),
        ("bodies.spawn", ["{id: x, shape: sphere, size: [1], mas: 3}"], "'mas' is unknown; did you mean 'mass'?"),
        ("bodies.spawn", ["{shape: sphere, size: [1]}"], "must be a mapping with id"),
    ],
)  # fmt: skip
def test_entries_that_cannot_be_are_refused(domain: int, parameter: str, entries: list[str], words: str) -> None:
    assert words in refusal_at_start({parameter: entries})
