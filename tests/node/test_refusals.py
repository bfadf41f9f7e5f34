"""Bad input: refused whole, counted by reason, and the last good state stays. What peers may make the node hold."""

import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray
from rclpy.serialization import serialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.node import session
from smartmesh_ros.node.inputs import cdr_reader, terrain_inputs
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import floats, heightmap_message, layer_message, pose_message
from tests.node.shared import BALL, Fed, Logged, fed, stamped

GOOD = np.random.default_rng(1).normal(size=(40, 30)) * 0.2


def changed(message: Any, **changes: Any) -> Any:
    """The message with fields set by dotted path (double underscores; numbers are places in lists)."""
    for path, value in changes.items():
        target = message
        *parents, name = path.split("__")
        for parent in parents:
            target = target[int(parent)] if parent.isdigit() else getattr(target, parent)
        setattr(target, name, value)
    return message


def bad_map(**changes: Any) -> Callable[[Fed], Any]:
    return lambda node: changed(stamped(node, heightmap_message(GOOD + 5.0)), **changes)


def bad_update(**changes: Any) -> Callable[[Fed], Any]:
    heights = floats(np.full(4, 9.0, np.float32))
    return lambda node: changed(stamped(node, HeightmapUpdate(x=3, y=3, width=2, height=2, heights=heights)), **changes)


def bad_bodies(*bodies: TrackedBody, **changes: Any) -> Callable[[Fed], Any]:
    rover = TrackedBody(id="rover", pose=pose_message((1, 1, 1)))
    return lambda node: changed(stamped(node, TrackedBodyArray(bodies=[rover, *bodies])), **changes)


# Messages of a peer whose encoder is broken; requests: test_cyclone.py.
WHOLE, NO_BODIES = serialize_message(heightmap_message(GOOD)), serialize_message(TrackedBodyArray())
BROKEN = [
    *(("heightmap", data) for data in (WHOLE[:50], WHOLE[:7], WHOLE[:4] + b"\xff" * 60, b"\0")),
    ("tracked_bodies", NO_BODIES[:-4] + struct.pack("<I", 2**31)),  # a count of bodies far beyond what follows
]


def body(**changes: Any) -> TrackedBody:
    return changed(TrackedBody(id="other", pose=pose_message((1, 1, 1))), **changes)


NAN = float("nan")
CASES = [
    ("heightmap", "length", bad_map(info__width=31)),
    ("heightmap", "length", bad_map(velocities=floats(np.zeros(7, np.float32)))),
    ("heightmap", "size", bad_map(info__width=2**32 - 1, info__height=2**32 - 1)),
    ("heightmap", "length", bad_map(info__width=0, info__height=2**32 - 1)),
    ("heightmap", "geometry", bad_map(info__width=1, info__height=1200)),
    ("heightmap", "quaternion", bad_map(info__origin__orientation__w=0.0)),
    ("heightmap", "quaternion", bad_map(info__origin__orientation__x=0.6, info__origin__orientation__w=0.8)),
    ("heightmap", "non_finite", bad_map(heights=floats(np.full(1200, np.inf, np.float32)))),
    ("heightmap", "length", bad_map(friction=floats(np.ones(1199, np.float32)))),
    ("heightmap", "friction", bad_map(friction=floats(np.full(1200, -0.1, np.float32)))),
    ("heightmap", "length", bad_map(layers=[layer_message("rolling", np.ones(1199))])),
    ("heightmap", "layer", bad_map(layers=[layer_message("colour", 1.0)])),
    ("heightmap", "layer", bad_map(layers=[layer_message("rolling", 0.1)] * 2)),
    ("heightmap_update", "restitution", bad_update(layers=[layer_message("restitution", 2.0)])),
    ("heightmap", "frame", bad_map(header__frame_id="odom")),
    ("heightmap", "stamp_backwards", bad_map(header__stamp=Time(sec=10))),
    ("heightmap", "stamp", bad_map(header__stamp=Time(sec=-5))),
    ("heightmap", "stamp", bad_map(header__stamp=Time(nanosec=2_000_000_000))),
    ("heightmap_update", "region", bad_update(y=2**32 - 1)),
    ("heightmap_update", "length", bad_update(width=3)),
    ("heightmap_update", "length", bad_update(width=0, height=0, heights=floats(np.zeros(0, np.float32)))),
    ("heightmap_update", "size", bad_update(width=2**32 - 1, height=2**32 - 1)),
    ("heightmap_update", "non_finite", bad_update(heights=floats(np.full(4, np.inf, np.float32)))),
    ("heightmap_update", "unknown_tile", bad_update(tile="north")),
    ("heightmap_update", "frame", bad_update(header__frame_id="odom")),
    ("heightmap_update", "stamp_backwards", bad_update(header__stamp=Time(sec=10))),
    ("tracked_bodies", "duplicate_id", bad_bodies(body(id="rover"))),
    ("tracked_bodies", "empty_id", bad_bodies(body(id=""))),
    ("tracked_bodies", "quaternion", bad_bodies(body(pose__orientation__w=0.0))),
    ("tracked_bodies", "non_finite", bad_bodies(body(pose__position__x=NAN))),
    ("tracked_bodies", "non_finite", bad_bodies(body(twist__angular__z=math.inf))),
    ("tracked_bodies", "geometry", bad_bodies(body(radius=-1.0))),
    ("tracked_bodies", "frame", bad_bodies(header__frame_id="odom")),
    ("tracked_bodies", "duplicate_id", bad_bodies(body(id="ball"))),
    ("body_poses", "non_finite", lambda node: stamped(node, PoseArray(poses=[pose_message((1, 1, math.inf))]))),
]


def test_every_bad_message_is_refused_counted_and_changes_nothing(logged: Logged) -> None:
    rows, columns = 0.1 * np.mgrid[:40, :30]
    with fed({"terrain.motion": "hold"}) as node:
        node.require_refused("heightmap_update", [("no_map", bad_update()(node))])
        node.give("heightmap", stamped(node, heightmap_message(GOOD)))
        node.world.spawn("ball", Sphere(0.2), 1.0, BodyState((2.0, 2.0, 1.0)))
        for topic, reason, make in CASES:
            node.require_refused(topic, [(reason, make(node))])
        for topic, data in BROKEN:
            node.require_refused(topic, [("malformed", data)])
        # The last good map is still there, and nothing but the ball is on it.
        assert node.world.bodies.keys() == {"ball"}
        np.testing.assert_allclose(node.heights(columns, rows), GOOD, atol=1e-6)
        # Each reason was logged, and said what would be right.
        said = logged()
        frame = "is not the terrain's frame 'map'; the parameter frame_id sets that"
        for words in ("there must be 1240", "at least 3 x 3", frame, "known: ''", "length 1, such as (0, 0, 0, 1)"):
            assert words in said
        # And good input is taken as before.
        node.give("heightmap", stamped(node, heightmap_message(GOOD + 1.0)))
        np.testing.assert_allclose(node.heights(columns, rows), GOOD + 1.0, atol=1e-6)


@pytest.mark.parametrize("changes", ["motion", "correction"])
def test_moving_ground_goes_on_though_a_map_of_another_clock_is_refused(now: list[float], changes: str) -> None:
    with fed({"terrain.changes": changes, "terrain.settle": 5.0}) as node:
        for k in range(5):
            good = changed(heightmap_message(GOOD + 0.1 * k), header__frame_id="map", header__stamp=stamp_of(now[0]))
            node.play(now, 0.1, 1.0, lambda good=good: node.give("heightmap", good, steps=0))
        before, ahead = node.world.ground_at([[1.0, 1.0]]), Time(sec=10_000)
        refused = bad_map(heights=floats(np.full(1200, np.inf, np.float32)), header__stamp=ahead)(node)
        outside = bad_update(y=2**32 - 1, header__stamp=ahead)(node)
        for topic, reason, message in [("heightmap", "non_finite", refused), ("heightmap_update", "region", outside)]:
            for _ in range(3):
                node.give(topic, message, steps=0)
            assert node.node.refusals.counts[f"{topic}: {reason}"] == 3
        ground = node.world.ground_at([[1.0, 1.0]])
        for name in ("z", "ages", "velocities"):
            assert getattr(ground, name) == pytest.approx(getattr(before, name), abs=1e-9)


def test_bad_spawns_are_answered_with_what_is_wrong() -> None:
    """What else a world refuses: tests/world/test_world.py."""
    with Replay([("heightmap", 0.0, heightmap_message(GOOD))]) as run:
        run.run()
        usual = {"id": "new", "shape": BALL, "mass": 1.0, "pose": pose_message((0, 0, 1))}
        assert run.call("spawn_body", SpawnBody.Request(**usual | {"id": "ball"})).success
        bad: list[tuple[str, dict[str, Any]]] = [
            ("already", {"id": "ball"}),
            ("length 1", {"pose": changed(pose_message((0, 0, 0)), orientation__w=0.0)}),
            ("SPHERE needs 1", {"shape": SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2, 0.2])}),
            ("not supported", {"shape": SolidPrimitive(type=SolidPrimitive.CONE, dimensions=[0.2, 0.2])}),
            ("beside the map", {"pose": pose_message((500, 0, 0)), "on_ground": True}),
        ]
        for words, fields in bad:
            answer = run.call("spawn_body", SpawnBody.Request(**usual | fields))
            assert not answer.success
            assert words in answer.message
        assert not run.call("remove_body", RemoveBody.Request(id="nobody")).success
        assert run.world.bodies.keys() == {"ball"}


def test_sizes_are_capped(monkeypatch: pytest.MonkeyPatch) -> None:
    """In all, and of each message; the caps are lowered here."""
    monkeypatch.setattr(session, "MOST_BODIES", 3)
    for module in (terrain_inputs, cdr_reader):
        monkeypatch.setattr(module, "MOST_SAMPLES", 2000)

    def tile(side: int, name: str) -> Heightmap:
        return heightmap_message(np.zeros((side, 30)), tile=name, origin=(50.0, 0.0, 0.0))

    with Replay([("heightmap", 0.0, tile(30, ""))]) as run:
        run.run()
        assert not run.refused
        for side, name in ((40, "large in all tiles together"), (67, "large"), (10, "x" * 257)):
            run.give("heightmap", tile(side, name))
        assert run.refused == {"heightmap: size": 2, "heightmap: name": 1}

        def answer(name: str) -> str:
            """What is wrong with a body; empty if it was spawned."""
            request = SpawnBody.Request(id=name, shape=BALL, mass=1.0, pose=pose_message((1, 1, 1)))
            return str(run.call("spawn_body", request).message)

        assert "at most 256" in answer("x" * 257)
        # Bodies, by service and by topic.
        assert [answer(name) for name in "abc"] == [""] * 3
        assert "4 bodies; at most 3 are possible" in answer("d")
        for count in (1, 4):
            run.give("body_poses", PoseArray(poses=[pose_message((1.0, 1.0, 0.3))] * count))
        assert run.refused["body_poses: size"] == 2
        assert run.call("remove_body", RemoveBody.Request(id="a")).success
        assert answer("d") == ""
