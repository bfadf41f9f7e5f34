"""States of peers are read from bytes as ROS itself reads them, and nothing else is taken for them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros import BodyState, Box, Capsule, HeightMap, InputError, PhysicsConfig, Sphere, World
from smartmesh_ros.node.fleet.peer_states import PeerReader
from smartmesh_ros.node.outputs.body_outputs import BodyStates
from smartmesh_ros.world.state_table import require_valid, simulated_states

MOST, LONGEST = 1000, 64


def message_of(names: list[str], seed: int, frame: str = "map") -> TrackedBodyArray:
    rng = np.random.default_rng(seed)
    bodies = []
    for name in names:
        x = rng.normal(size=13)
        pose = Pose(position=Point(x=x[0], y=x[1], z=x[2]), orientation=Quaternion(x=x[3], y=x[4], z=x[5], w=x[6]))
        twist = Twist(linear=Vector3(x=x[7], y=x[8], z=x[9]), angular=Vector3(x=x[10], y=x[11], z=x[12]))
        kind = int(rng.integers(5))
        sizes = rng.uniform(0.1, 1.0, 3).astype(np.float32)
        body = TrackedBody(id=name, pose=pose, twist=twist, radius=0.5, shape=kind, dimensions=sizes, mass=2.0)
        body.centre = rng.normal(size=3).astype(np.float32)
        bodies.append(body)
    message = TrackedBodyArray(bodies=bodies, ahead=0.004, rate=240.0, gravity=np.array([0, 0, -9.81], np.float32))
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = 7, 8
    return message


NAMES = st.lists(st.text("abcdefg_äß", min_size=1, max_size=9), unique=True, max_size=6)


@given(names=NAMES, seed=st.integers(0, 2**32 - 1), frame=st.text("map/_", max_size=7))
def test_messages_are_read_as_ros_reads_them(names: list[str], seed: int, frame: str) -> None:
    message = message_of(names, seed, frame)
    reader = PeerReader()
    for _ in range(2):  # the second time with known names
        read = reader.read(bytes(serialize_message(message)), MOST, LONGEST)
        assert (read.sec, read.nanosec, read.frame_id, read.rate) == (7, 8, frame, 240.0)
        assert math.isclose(read.ahead, 0.004, rel_tol=1e-6)
        assert read.bodies.names == names
        for row, body in enumerate(message.bodies):
            pose, twist = body.pose, body.twist
            parts = (pose.position, pose.orientation, twist.linear, twist.angular)
            numbers = iter(read.bodies.numbers[row].tolist())
            for part, axes in zip(parts, ("xyz", "xyzw", "xyz", "xyz"), strict=True):
                assert all(getattr(part, axis) == next(numbers) for axis in axes)
            assert read.bodies.kinds[row] == body.shape
            assert read.bodies.dimensions[row].tolist() == body.dimensions.tolist()
            assert read.bodies.centres[row].tolist() == body.centre.tolist()
            assert (read.bodies.radii[row], read.bodies.masses[row]) == (0.5, 2.0)


@given(names=NAMES, seed=st.integers(0, 2**32 - 1), data=st.data())
def test_spoilt_messages_are_refused_or_read_and_nothing_else(names: list[str], seed: int, data: Any) -> None:
    whole = bytearray(serialize_message(message_of(names, seed)))
    reader = PeerReader()
    reader.read(bytes(whole), MOST, LONGEST)
    spoilt = whole[: data.draw(st.integers(0, len(whole)))]
    for _ in range(data.draw(st.integers(0, 4))):
        if spoilt:
            spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    try:
        read = reader.read(bytes(spoilt), MOST, LONGEST)
        require_valid(read.bodies)
    except InputError as error:
        assert str(error)
    assert reader.read(bytes(whole), MOST, LONGEST).bodies.names == names


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bodies": [TrackedBody(id="a"), TrackedBody(id="a")]}, "duplicate_id"),
        ({"bodies": [TrackedBody(id="")]}, "empty_id"),
        ({"bodies": [TrackedBody(id="a/b")]}, "empty_id"),
        ({"bodies": [TrackedBody(id="x" * 65)]}, "size"),
        ({"bodies": [TrackedBody(id=f"{k}") for k in range(1001)]}, "size"),
        ({"ahead": math.nan}, "non_finite"),
        ({"ahead": 1e9}, "stamp"),
        ({"gravity": np.array([0, 0, math.inf], np.float32)}, "non_finite"),
    ],
)
def test_hostile_messages_are_refused_by_reason(change: dict[str, Any], reason: str) -> None:
    message = TrackedBodyArray(rate=240.0)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(InputError) as refused:
        PeerReader().read(bytes(serialize_message(message)), MOST, LONGEST)
    assert refused.value.reason == reason


def test_what_a_node_writes_is_what_its_peers_read() -> None:
    with World(HeightMap(np.zeros((9, 9)), resolution=1.0)) as world:
        for name, shape in (
            ("ball", Sphere(0.25)),
            ("box", Box(0.5, 0.25, 1.0, centre=(0.25, 0.0, -0.5))),
            ("longer", Capsule(0.25, 0.5)),
        ):
            world.spawn(name, shape, 2.0, BodyState((4.0, 4.0, 3.0), linear=(1.0, 2.0, 3.0)))
        states = simulated_states(world)
        data = BodyStates().write(Header(frame_id="map"), states, PhysicsConfig(), 0.25)
    message = deserialize_message(data, TrackedBodyArray)
    assert [body.shape for body in message.bodies] == [
        TrackedBody.SHAPE_SPHERE, TrackedBody.SHAPE_BOX, TrackedBody.SHAPE_CAPSULE,
    ]  # fmt: skip
    read = PeerReader().read(data, MOST, LONGEST)
    assert (read.ahead, read.rate, read.frame_id) == (0.25, 240.0, "map")
    assert read.bodies.same_bodies(states)
    assert np.array_equal(read.bodies.numbers, states.numbers)
