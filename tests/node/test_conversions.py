"""Messages read from bytes are what rclpy serialised, and nothing else is taken for states of peers.

That these are read as ROS reads them: test_outputs.py.
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from rclpy.serialization import serialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodyDescription, TrackedBody, TrackedBodyArray

from smartmesh_ros import InputError
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.fleet import peers
from smartmesh_ros.node.fleet.peers import PeerReader
from smartmesh_ros.node.inputs.cdr_reader import map_from
from smartmesh_ros.node.inputs.conversions import primitive_of, shape_of_primitive
from smartmesh_ros.node.outputs.body_outputs import description
from smartmesh_ros.tools.testing import assert_on_map, heightmap_message
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.state_table import require_valid

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
floats32 = st.floats(-1e6, 1e6, width=32, allow_subnormal=False)
grids = npst.arrays(np.float32, st.tuples(st.integers(3, 12), st.integers(3, 12)), elements=floats32 | st.just(np.nan))
places = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


def test_masked_heights_are_holes_and_others_than_a_grid_are_refused() -> None:
    """A mask that is left out would make ground of what is no ground."""
    heights = np.ma.masked_equal(np.where(np.eye(4), -9999.0, 1.0), -9999.0)
    message = heightmap_message(heights, friction=heights, layers={"damping": heights})
    raster = map_from(serialize_message(message)).raster
    assert raster is not None
    for values in (raster.heights, raster.material.friction, raster.material.damping):
        np.testing.assert_array_equal(np.isnan(values), np.eye(4))
    for values in (np.zeros(4), [[0.0], [0.0, 0.0]]):
        with pytest.raises(InputError, match="heights"):
            heightmap_message(values)


def test_vertices_in_holes_are_on_the_map_and_others_without_height_or_none_at_all_are_not() -> None:
    heights = np.where(np.eye(4), np.nan, 1.0)
    rows, columns = np.indices((4, 4))
    vertices = np.column_stack([0.1 * columns.ravel(), 0.1 * rows.ravel(), heights.ravel()])
    assert_on_map(vertices, heightmap_message(heights))
    with pytest.raises(AssertionError, match="a vertex is not at its sample's height"):
        assert_on_map(vertices, heightmap_message(np.ones((4, 4))))
    with pytest.raises(AssertionError, match="there are no points"):
        assert_on_map(np.empty((0, 3)), heightmap_message(heights))


@settings(deadline=None)
@example("/", "", np.zeros((3, 3), np.float32), (0.0, 0.0, 0.0), 0.0, False, "")
@given(texts, texts, grids, places, st.floats(-3.1, 3.1), st.booleans(), st.sampled_from(["", "one", "each"]))
def test_a_map_is_what_was_sent(
    frame_id: str, tile: str, heights: np.ndarray, origin: tuple[float, ...], yaw: float, moving: bool, rubs: str
) -> None:
    friction = {"": None, "one": 0.25, "each": 3 * heights}[rubs]
    soil = None if rubs == "one" else np.arange(heights.size).reshape(heights.shape) % 5
    layers = {"": {"rolling": 0.25}, "one": {}, "each": {"stiffness": 1e5, "damping": 2 * heights}}[rubs]
    message = heightmap_message(
        heights, frame_id=frame_id, tile=tile, origin=origin, yaw=yaw, velocities=2 * heights if moving else None,
        friction=friction, soil=soil, layers=layers,
    )  # fmt: skip
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
    data = serialize_message(message)
    start, new = map_from(data)
    assert start == (12, 34, frame_id.strip("/"), tile)
    assert new is not None
    assert np.shares_memory(new.heights, np.frombuffer(data, np.uint8)), "no copy is made before that into the map"
    assert new.geometry.origin == origin
    assert new.geometry.yaw == pytest.approx(yaw)
    np.testing.assert_array_equal(new.heights, heights)
    assert (new.velocities is not None) == moving
    if moving:
        np.testing.assert_array_equal(new.velocities, 2 * heights)
    sent = {name: layer for name, layer in {"friction": friction, "soil": soil, **layers}.items() if layer is not None}
    assert new.material.layers.keys() == sent.keys()
    for name, layer in sent.items():
        np.testing.assert_array_equal(new.material.layers[name], layer)


SHAPES = [Sphere(0.2), Box(0.1, 0.2, 0.3), Cylinder(radius=0.1, height=0.5), Capsule(radius=0.1, height=0.5)]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_shape_has_one_number_and_one_order_of_dimensions_in_all_messages(shape: Shape) -> None:
    """They are those of SolidPrimitive, which `SpawnBody` takes."""
    name, asked = type(shape).__name__.upper(), primitive_of(shape)
    assert shape_of_primitive(asked) == shape
    numbers = [getattr(BodyDescription, name), getattr(TrackedBody, f"SHAPE_{name}")]
    assert numbers == [asked.type] * 2
    assert asked.type == getattr(SolidPrimitive, name, numbers[0])
    described = description(Body("it", 0, 1.0, False, BodyState(), {}, {}, shape=shape))
    assert (described.shape, [*described.dimensions]) == (asked.type, [*asked.dimensions])
    for number, size in shape.dimensions.items():
        place = getattr(SolidPrimitive, f"{name}_{number.upper()}", None)
        assert place is None or asked.dimensions[place] == size


@given(names=st.lists(st.text("abcdefg_äß", min_size=1, max_size=9), unique=True, max_size=6), data=st.data())
def test_spoilt_messages_are_refused_or_read_and_nothing_else(names: list[str], data: Any) -> None:
    bodies = [TrackedBody(id=name, shape=TrackedBody.SHAPE_SPHERE, radius=0.5, mass=2.0) for name in names]
    whole = bytearray(serialize_message(TrackedBodyArray(bodies=bodies, rate=240.0)))
    reader = PeerReader()
    reader.read(bytes(whole))
    spoilt = whole[: data.draw(st.integers(0, len(whole)))]
    for _ in range(data.draw(st.integers(0, 4))):
        if spoilt:
            spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    try:
        read = reader.read(bytes(spoilt))
        require_valid(read.bodies)
    except InputError as error:
        assert str(error)
    assert reader.read(bytes(whole)).bodies.names == names


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bodies": [TrackedBody(id="a"), TrackedBody(id="a")]}, "duplicate_id"),
        *[({"bodies": [TrackedBody(id=name)]}, "empty_id") for name in ("a/b", " ", "\x1b[2J")],
        ({"bodies": [TrackedBody(id="x" * 257)]}, "name"),
        ({"bodies": [TrackedBody()] * 4}, "size"),
        ({"ahead": math.nan}, "non_finite"),
        ({"ahead": 1e9}, "stamp"),
        ({"gravity": np.array([0, 0, math.inf], np.float32)}, "non_finite"),
    ],
)
def test_hostile_messages_are_refused_by_reason(
    monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], reason: str
) -> None:
    """The cap of bodies is lowered here."""
    monkeypatch.setattr(peers, "MOST_BODIES", 3)
    with pytest.raises(InputError) as refused:
        PeerReader().read(bytes(serialize_message(TrackedBodyArray(rate=240.0, **change))))
    assert refused.value.reason == reason
