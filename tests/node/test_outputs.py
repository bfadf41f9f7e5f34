"""Messages written as bytes are what rclpy would have serialised."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Quaternion, Twist, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from shape_msgs.msg import Mesh, MeshTriangle
from smartmesh_msgs.msg import (
    ColliderPatch,
    ColliderPatchArray,
    Contact,
    ContactArray,
    TrackedBody,
    TrackedBodyArray,
)
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.node.fleet.peers import PeerReader
from smartmesh_ros.node.outputs import body_outputs, patch_outputs
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.shapes import BODY_COLUMNS, ball
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.state_table import StateTable
from tests.bodies import shapes_of
from tests.ground.selecting import Selecting

HEADER = Header(frame_id="some_map")
PHYSICS = PhysicsConfig(rate=120.0)
HEADER.stamp.sec, HEADER.stamp.nanosec = 1234, 567890123

names = st.text(st.characters(min_codepoint=33, max_codepoint=0x2FF, exclude_characters="/"), min_size=1, max_size=12)
numbers = st.floats(-1e6, 1e6, width=32)


def batches_of(terrain: Terrain, config: PatchConfig, positions: FloatArray, radii: FloatArray) -> list[PatchBatch]:
    """Patches of balls at rest at ``positions`` (N, 3)."""
    shapes = shapes_of(ball(radius) for radius in radii)
    selecting = Selecting(terrain, config, shapes)
    bodies = np.zeros((len(radii), BODY_COLUMNS))
    bodies[:, :3], bodies[:, 6] = positions, 1.0
    selecting.update(bodies, 0.01, 1.0 / 60.0)
    return selecting.batches()


def batches_for(count: int, radii: list[float], holes: bool) -> list[PatchBatch]:
    """Patches of bodies that lie on random moving ground."""
    rng = np.random.default_rng(count)
    heights = rng.normal(size=(60, 80)).astype(np.float32)
    if holes:
        heights[rng.random(heights.shape) < 0.05] = np.nan
    terrain = Terrain(HeightMap(heights, resolution=0.25, origin=(1.0, -2.0, 0.3), yaw=0.4, velocities=heights * 0.1))
    inner = terrain.tiles[""].geometry.to_world(rng.uniform(10, 50, count), rng.uniform(10, 70, count))
    # Above the ground, because a buried body has no known deviation, and NaN equals nothing.
    heights = np.nan_to_num(terrain.at(inner, 0.0).heights) + 0.05
    return batches_of(terrain, PatchConfig(), np.column_stack([inner, heights]), np.resize(radii, count))


def xyz(values: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", values, strict=True))


def assert_same(mine: bytes, reference: Any) -> None:
    """Equal as messages and equally long; only padding, which rclpy leaves undefined, may differ."""
    serialised = serialize_message(reference)
    assert deserialize_message(mine, type(reference)) == deserialize_message(serialised, type(reference))
    assert len(mine) == len(serialised)


def batches_of_two_kinds() -> list[PatchBatch]:
    """Height fields and meshes of one size, which are written together."""
    rng = np.random.default_rng(5)
    heightmap = HeightMap(rng.normal(size=(60, 80)), resolution=0.25, origin=(1.0, -2.0, 0.3), yaw=0.4)
    batches: list[PatchBatch] = []
    for config in (PatchConfig(kind="trimesh", rings=1), PatchConfig(kind="heightfield", rings=1)):
        places = heightmap.geometry.to_world(rng.uniform(10, 50, 9), rng.uniform(10, 70, 9))
        positions = np.column_stack([places, heightmap.at(places, 0.0).heights + 0.1])
        made = batches_of(Terrain(heightmap), config, positions, np.full(9, 0.1))
        batches += [replace(batch, bodies=batch.bodies + 9 * (config.kind == "heightfield")) for batch in made]
    assert {(batch.kind, len(batch.triangles)) for batch in batches} == {("trimesh", 8), ("heightfield", 8)}
    return batches


MADE = [partial(batches_for, count, [0.2, 0.4, 0.9], holes) for count in (0, 1, 2, 3, 7, 40) for holes in (False, True)]


@pytest.mark.parametrize("make", [*MADE, batches_of_two_kinds])
def test_markers_equal_those_of_message_objects(make: Callable[[], list[PatchBatch]]) -> None:
    """Patches that are written together: none may get the other's place or id."""
    expected = {}
    for batch in (batches := make()):
        for body, vertices in zip(batch.bodies.tolist(), batch.vertices_w, strict=True):
            triangles = vertices[batch.triangles]
            marker = Marker(header=HEADER, ns="patches", id=body, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
            marker.frame_locked = True  # shown in any Fixed Frame: RViz takes the newest transform, not the stamp's
            marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
            marker.color.r, marker.color.g, marker.color.b, marker.color.a = patch_outputs.COLOUR
            corners = triangles[~np.isnan(triangles).any(axis=(1, 2))].reshape(-1, 3).tolist()
            marker.points = [Point(**xyz(corner)) for corner in corners]
            if corners:
                expected[body] = marker
    mine = patch_outputs.PatchMarkers().write(HEADER, batches, [f"body_{index}" for index in range(40)], 1)
    order = [marker.id for marker in deserialize_message(mine, MarkerArray).markers]
    assert sorted(order) == sorted(expected)
    assert_same(mine, MarkerArray(markers=[expected[body] for body in order]))


def test_a_body_that_goes_is_deleted_once_and_keeps_its_id_while_it_stays() -> None:
    markers = patch_outputs.PatchMarkers()
    three = markers.write(HEADER, batches_for(3, [0.2], False), ["a", "b", "c"], 1)
    assert sorted(m.id for m in deserialize_message(three, MarkerArray).markers) == [0, 1, 2]
    two = ["c", "b"]
    after = deserialize_message(markers.write(HEADER, batches_for(2, [0.2], False), two, 2), MarkerArray).markers
    assert sorted((m.id, m.action) for m in after) == [(0, Marker.DELETE), (1, Marker.ADD), (2, Marker.ADD)]
    again = deserialize_message(markers.write(HEADER, batches_for(2, [0.2], False), two, 2), MarkerArray).markers
    clean = markers.write(HEADER, batches_for(2, [0.2], False), two, 2, clear=True)
    first, *rest = deserialize_message(clean, MarkerArray).markers
    assert (first.action, first.ns) == (Marker.DELETEALL, "patches")
    assert sorted(m.id for m in rest) == [1, 2] and first.id not in (1, 2), "RViz reports ids that come twice"
    [only] = deserialize_message(markers.cleared(HEADER), MarkerArray).markers
    assert (only.action, only.ns, only.header) == (Marker.DELETEALL, "patches", HEADER)
    assert sorted((m.id, m.action) for m in again) == [(1, Marker.ADD), (2, Marker.ADD)]


@settings(deadline=None, max_examples=60)
@given(st.lists(names, unique=True, max_size=30), st.booleans())
def test_collider_patches_equal_those_of_message_objects(bodies: list[str], carry: bool) -> None:
    batches = batches_for(len(bodies), [0.2, 0.2, 0.9], False)
    writer = patch_outputs.ColliderPatches()
    writer.write(
        HEADER, batches_for(4, [0.9], True), ["w", "x", "yy", "zzz"], 1, True
    )  # buffers are reused, so use them
    mine = writer.write(HEADER, batches, bodies, 2, carry)
    expected = {}
    for batch in batches:
        triangles = [MeshTriangle(vertex_indices=corners.astype(np.uint32)) for corners in batch.triangles]
        for row, (body, vertices) in enumerate(zip(batch.bodies.tolist(), batch.vertices_w.tolist(), strict=True)):
            twist = Twist()
            if carry:
                twist.linear = Vector3(**xyz(batch.linear_w[row].tolist()))
                twist.angular = Vector3(**xyz(batch.angular_w[row].tolist()))
            expected[bodies[body]] = ColliderPatch(
                body_id=bodies[body],
                row=int(batch.rows[row]),
                column=int(batch.columns[row]),
                stride=int(batch.stride[row]),
                deviation=float(batch.deviation[row]),
                surface_twist=twist,
                mesh=Mesh(triangles=triangles, vertices=[Point(x=x, y=y, z=z) for x, y, z in vertices]),
            )
    order = [patch.body_id for patch in deserialize_message(mine, ColliderPatchArray).patches]
    assert sorted(order) == sorted(bodies)
    assert_same(mine, ColliderPatchArray(header=HEADER, patches=[expected[name] for name in order]))


def message_of(states: StateTable) -> TrackedBodyArray:
    gravity = np.array(PHYSICS.gravity, np.float32)
    message = TrackedBodyArray(header=HEADER, ahead=0.25, rate=PHYSICS.rate, gravity=gravity)
    for row, v in enumerate(states.numbers.tolist()):
        body = TrackedBody(id=states.names[row], radius=states.radii[row], shape=int(states.kinds[row]))
        body.dimensions, body.centre = (
            values[row].astype(np.float32) for values in (states.dimensions, states.centres)
        )
        body.mass = states.masses[row]
        body.pose.position, body.pose.orientation = Point(**xyz(v[:3])), Quaternion(**xyz(v[3:6]), w=v[6])
        body.twist = Twist(linear=Vector3(**xyz(v[7:10])), angular=Vector3(**xyz(v[10:13])))
        message.bodies.append(body)
    return message


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(names, st.floats(0.125, 100.0, width=32), st.tuples(*[numbers] * 9)), max_size=30))
def test_body_states_equal_those_of_message_objects_and_peers_read_them(
    rows: list[tuple[str, float, tuple[float, ...]]],
) -> None:
    unit = (0.0, 0.6, 0.0, 0.8)
    table = np.array([(*v[0:3], *unit, *v[3:9]) for _, _, v in rows]).reshape(-1, 13)
    n, sizes, centre = len(rows), (0.5, 0.25, 0.125), (0.0, -0.5, 0.25)
    states = StateTable(
        [f"{row}{name}" for row, (name, _, _) in enumerate(rows)], table, np.array([radius for _, radius, _ in rows]),
        np.arange(n, dtype=np.uint8) % 5, np.tile(sizes, (n, 1)), np.tile(centre, (n, 1)), np.arange(1.0, n + 1.0),
    )  # fmt: skip
    writer, reader = body_outputs.BodyStates(), PeerReader()
    # The second time into the same buffer, where the constant bytes are left as they are, and with known names.
    for turned in (states, states._replace(numbers=table[::-1].copy())):
        expected = message_of(turned)
        assert_same(writer.write(HEADER, turned, PHYSICS, 0.25), expected)
        read = reader.read(bytes(serialize_message(expected)), 1000, 64)
        assert (read.sec, read.nanosec, read.frame_id) == (1234, 567890123, "some_map")
        assert (read.ahead, read.rate, read.gravity) == (0.25, PHYSICS.rate, pytest.approx(PHYSICS.gravity))
        for mine, theirs in zip(read.bodies, turned, strict=True):
            np.testing.assert_array_equal(mine, theirs)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(names, st.tuples(*[numbers] * 8)), max_size=30))
def test_contacts_equal_those_of_message_objects(rows: list[tuple[str, tuple[float, ...]]]) -> None:
    contacts = [GroundContact(name, v[0:3], v[3:6], v[6], v[7]) for name, v in rows]
    mine = body_outputs.Contacts().write(HEADER, contacts)
    received = deserialize_message(mine, ContactArray)
    messages = [
        Contact(
            body_id=name, position=Point(**xyz(v[0:3])), normal=Vector3(**xyz(v[3:6])), depth=v[6], normal_force=v[7]
        )
        for name, v in rows
    ]
    assert sorted(map(str, received.contacts)) == sorted(map(str, messages))
    assert_same(mine, received)


def changing_batches(turn: int, holes: bool, rng: np.random.Generator) -> list[PatchBatch]:
    """Patches of twenty bodies that change their sizes now and then, or move and lose some of them."""
    batches = batches_for(20, [0.2, 0.4, 0.9] if turn % 4 else [0.9, 0.2], holes)
    if turn % 3 == 0:
        batches = [replace(batch, vertices_w=batch.vertices_w + [0.0, 0.0, rng.normal()]) for batch in batches[:-1]]
    return batches


def keep(known: dict[Any, Any], message: Any) -> None:
    """What a viewer knows after a message: markers by id as RViz, patches by body as the message definition says."""
    if isinstance(message, MarkerArray):
        for marker in message.markers:
            known.pop(marker.id, None)
            if marker.action == Marker.ADD:
                known[marker.id] = str(marker)
        return
    if not message.incremental:
        assert not message.removed
        known.clear()
    for name in message.removed:
        del known[name]
    known.update((patch.body_id, str(patch)) for patch in message.patches)


@pytest.mark.parametrize("holes", [False, True])
@pytest.mark.parametrize(
    ("kind", "message"),
    [(patch_outputs.PatchMarkers, MarkerArray), (patch_outputs.ColliderPatches, ColliderPatchArray)],
)
def test_changes_alone_make_the_same_picture(kind: Any, message: Any, holes: bool) -> None:
    """A viewer knows after each incremental message what a full one would tell it."""
    names = [f"body_{index}" for index in range(20)]
    rng = np.random.default_rng(3)

    def written(writer: Any, batches: list[PatchBatch], turn: int, **options: Any) -> Any:
        carry = [turn < 12] if message is ColliderPatchArray else []
        data = writer.write(HEADER, batches, names, 1, *carry, **options)
        made = deserialize_message(data, message)
        assert len(data) == len(serialize_message(made))
        return made

    writer, seen, sizes = kind(), dict[Any, Any](), []
    for turn in range(16):
        batches = changing_batches(turn, holes, rng)
        if turn % 5 == 1:  # alike in shape, and of another speed or precision
            batches = [replace(batch, linear_w=batch.linear_w + rng.normal()) for batch in batches]
        if turn % 5 == 2:
            batches = [replace(batch, deviation=np.full(len(batch.bodies), rng.random())) for batch in batches]
        changes = written(writer, batches, turn, only_changed=turn not in (0, 5))
        sizes.append(len(getattr(changes, "markers", None) or getattr(changes, "patches", [])))
        keep(seen, changes)
        whole: dict[Any, Any] = {}
        keep(whole, written(kind(), batches, turn))
        assert seen == whole
    still = written(writer, batches, 15, only_changed=True)
    assert len(getattr(still, "markers", [])) + len(getattr(still, "patches", [])) <= 20 * holes, "nothing changed"
    assert min(sizes) < max(sizes)
