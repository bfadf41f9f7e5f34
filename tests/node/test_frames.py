"""Transforms between frames, against matrices."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import HeightmapUpdate, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.frames import HISTORY, MAX_HOLD, FrameBuffer
from smartmesh_ros.node.inputs.transform_input import transforms_from
from smartmesh_ros.tools.testing import floats, heightmap_message
from tests.bodies import about_z, rotation
from tests.examples import examples
from tests.node.shared import fed

NUMBERS = st.floats(-10.0, 10.0)
FAR = st.floats(-1e6, 1e6)  # as in UTM coordinates


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    q = np.array(draw(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)))
    assume(np.linalg.norm(q) > 0.1)
    return Transform(draw(st.tuples(FAR, FAR, NUMBERS)), tuple((q / np.linalg.norm(q)).tolist()))


def matrix(transform: Transform) -> NDArray[np.float64]:
    """The 4 x 4 matrix of a pose, by the textbook."""
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rotation(np.array(transform.rotation)), transform.translation
    return whole


@examples(60)
@given(parents=st.lists(st.integers(0, 7), min_size=1, max_size=8), data=st.data())
def test_any_two_frames_of_a_tree_are_related_as_matrices_say(parents: list[int], data: st.DataObject) -> None:
    """Frame i + 1 hangs below one of the frames before it; frame 0 is the root."""
    buffer, in_root = FrameBuffer(), [np.eye(4)]
    for index, parent in enumerate(parents):
        above = parent % (index + 1)
        transform = data.draw(transforms())
        buffer.add(f"f{above}", f"f{index + 1}", transform, 5.0 if data.draw(st.booleans()) else None)
        in_root.append(in_root[above] @ matrix(transform))
    for a in range(len(in_root)):
        for b in range(len(in_root)):
            found, _ = buffer.lookup(f"f{a}", f"f{b}", 5.0)
            wanted = np.linalg.inv(in_root[a]) @ in_root[b]
            assert np.allclose(matrix(found), wanted, rtol=0.0, atol=1e-6)


@examples(60)
@given(transforms(), transforms())
def test_states_are_turned_as_matrices_say(outer: Transform, inner: Transform) -> None:
    state = BodyState(inner.translation, inner.rotation, (1.0, -2.0, 3.0), (0.3, 0.2, 0.1))
    seen = outer.apply(state)
    assert np.allclose(
        matrix(Transform(seen.position, seen.orientation)), matrix(outer) @ matrix(inner), rtol=0.0, atol=1e-6
    )
    assert np.allclose(seen.linear, matrix(outer)[:3, :3] @ (1.0, -2.0, 3.0), atol=1e-9)
    assert np.allclose(seen.angular, matrix(outer)[:3, :3] @ (0.3, 0.2, 0.1), atol=1e-9)


def turned(yaw: float, x: float = 0.0) -> Transform:
    return Transform((x, 0.0, 0.0), about_z(yaw))


@examples(60)
@given(share=st.floats(0.0, 1.0))
def test_between_two_transforms_it_is_interpolated(share: float) -> None:
    buffer = FrameBuffer()
    buffer.add("odom", "base", turned(0.0, 1.0), 10.0)
    buffer.add("odom", "base", turned(1.0, 3.0), 10.5)
    found, _ = buffer.lookup("odom", "base", 10.0 + 0.5 * share)
    assert np.allclose(matrix(found), matrix(turned(share, 1.0 + 2.0 * share)), atol=1e-9)


def test_the_newest_time_that_all_frames_know_is_taken() -> None:
    buffer = FrameBuffer()
    buffer.add("base", "wheel", turned(0.3), None)
    assert buffer.lookup("base", "wheel") == (turned(0.3), None)
    assert buffer.lookup("/base", "/wheel") == (turned(0.3), None), "a leading slash means nothing, as to tf2"
    for step in range(6):
        buffer.add("odom", "base", turned(0.0, float(step)), 10.0 + 0.1 * step)
        if step < 4:
            buffer.add("map", "odom", turned(0.0), 10.0 + 0.1 * step)
    found, stamp = buffer.lookup("map", "wheel")
    assert stamp == pytest.approx(10.3)
    assert found.translation[0] == pytest.approx(3.0)


def test_what_is_not_known_then_is_refused() -> None:
    buffer = FrameBuffer()
    buffer.add("map", "odom", turned(0.0), 10.0)
    buffer.add("map", "odom", turned(0.0), 11.0)
    buffer.lookup("map", "odom", 11.0 + 0.9 * MAX_HOLD)
    for stamp in (9.9, 11.0 + 1.1 * MAX_HOLD):
        with pytest.raises(InputError, match="not at the requested"):
            buffer.lookup("map", "odom", stamp)
    with pytest.raises(InputError, match="no transform from 'base' to 'map'; known frames: map, odom"):
        buffer.lookup("map", "base", 11.0)
    buffer.add("odom", "map", turned(0.0), None)
    with pytest.raises(InputError, match="form a cycle"):
        buffer.lookup("map", "odom", 11.0)


@pytest.mark.parametrize(
    ("parent", "child", "transform"),
    [
        ("a", "", turned(0.0)),
        ("a", "a", turned(0.0)),
        ("a", "b", turned(0.0, math.nan)),
        ("a", "b", Transform((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0))),
    ],
)
def test_impossible_transforms_are_refused(parent: str, child: str, transform: Transform) -> None:
    buffer = FrameBuffer()
    with pytest.raises(InputError):
        buffer.add(parent, child, transform, 1.0)
    assert buffer.version == 0


def test_memory_is_bounded() -> None:
    buffer = FrameBuffer()
    for step in range(20_000):
        buffer.add("odom", "base", turned(0.0, step), 100.0 + 0.01 * step)
    assert len(buffer._edges["base"].stamps) <= 1.5 * HISTORY / 0.01
    buffer.lookup("odom", "base", 100.0 + 0.01 * 20_000 - 0.9 * HISTORY)


@examples(60)
@given(st.permutations(range(8)))
def test_transforms_may_come_in_any_order(order: list[int]) -> None:
    sorted_ones, shuffled = FrameBuffer(), FrameBuffer()
    for step in range(8):
        assert sorted_ones.add("odom", "base", turned(0.0, step), 10.0 + 0.1 * step) == 0.0
    for step in order:
        assert shuffled.add("odom", "base", turned(0.0, step), 10.0 + 0.1 * step) == 0.0
    for stamp in np.linspace(10.0, 10.7, 30).tolist():
        assert shuffled.lookup("odom", "base", stamp) == sorted_ones.lookup("odom", "base", stamp)
    shuffled.add("odom", "base", turned(0.0, 9.0), 10.7)
    assert shuffled.lookup("odom", "base")[0].translation[0] == 9.0, "the last one of a stamp counts"


@examples(60)
@given(
    st.lists(
        st.tuples(st.integers(-(2**31), 2**31 - 1), st.text(max_size=9), st.text(max_size=9), transforms()), max_size=5
    )
)
def test_transforms_are_read_from_bytes_as_they_were_written(items: list[tuple[int, str, str, Transform]]) -> None:
    message = TFMessage()
    for sec, parent, child, transform in items:
        item = TransformStamped(child_frame_id=child.replace("\0", ""))
        item.header.frame_id, item.header.stamp.sec = parent.replace("\0", ""), sec
        p, q = item.transform.translation, item.transform.rotation
        (p.x, p.y, p.z), (q.x, q.y, q.z, q.w) = transform
        message.transforms.append(item)
    data = serialize_message(message)
    read = list(transforms_from(data))
    assert read == [
        ((item.header.stamp.sec, 0, item.header.frame_id.strip("/"), item.child_frame_id), transform)
        for item, (*_, transform) in zip(message.transforms, items, strict=True)
    ]


@pytest.mark.parametrize("chosen", ["", "/map", "map"])
def test_a_leading_slash_of_the_terrains_frame_means_nothing(chosen: str) -> None:
    """Else its outputs were in a frame that tf2 refuses."""
    level = np.zeros((10, 10))
    with fed({"frame_id": chosen, "decks": ["{deck: ferry, frame: /ferry}"]}) as node:
        for frame in ("/map", "map", "/ferry", "ferry"):
            node.give("heightmap", heightmap_message(level, frame_id=frame))
        for frame in ("/map", "map"):
            header, heights = Header(frame_id=frame), floats(level[:1, :1])
            node.give("heightmap_update", HeightmapUpdate(header=header, width=1, height=1, heights=heights))
            node.give("tracked_bodies", TrackedBodyArray(header=header, bodies=[TrackedBody(id="a")]))
        assert node.node.session.frame_id == "map"
        assert set(node.node.refusals.counts) == {"decks: frame"}, "of ferry there is no transform"
        assert [*node.world.terrain.tiles] == [""]
