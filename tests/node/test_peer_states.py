"""Nothing else is taken for states of peers. That these are read as ROS reads them: test_outputs.py."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray

from smartmesh_ros import InputError
from smartmesh_ros.node.fleet.peers import PeerReader
from smartmesh_ros.world.state_table import require_valid

MOST, LONGEST = 1000, 64


@given(names=st.lists(st.text("abcdefg_äß", min_size=1, max_size=9), unique=True, max_size=6), data=st.data())
def test_spoilt_messages_are_refused_or_read_and_nothing_else(names: list[str], data: Any) -> None:
    bodies = [TrackedBody(id=name, shape=TrackedBody.SHAPE_SPHERE, radius=0.5, mass=2.0) for name in names]
    whole = bytearray(serialize_message(TrackedBodyArray(bodies=bodies, rate=240.0)))
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
