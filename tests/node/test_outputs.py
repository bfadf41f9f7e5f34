"""Messages written as bytes are what rclpy would have serialised."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Quaternion, Twist, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from shape_msgs.msg import Mesh, MeshTriangle
from smartmesh_msgs.msg import ColliderPatch, ColliderPatchArray, Contact, ContactArray, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.node.fleet.peers import PeerReader
from smartmesh_ros.node.outputs import body_outputs, patch_outputs
from smartmesh_ros.node.outputs.cdr import ArrayMessage
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.tools.testing import points_of
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.state_table import StateTable
from tests.core import mesh_parts
from tests.ground.test_shown_patches import Reaching, balls_on
from tests.grounds import patch_of

HEADER = Header(frame_id="some_map")
PHYSICS = PhysicsConfig(rate=120.0)
HEADER.stamp.sec, HEADER.stamp.nanosec = 1234, 567890123

printable = st.characters(max_codepoint=0x2FF, exclude_categories=["C", "Z"], exclude_characters="/")
names = st.text(printable, min_size=1, max_size=12)
numbers = st.floats(-1e6, 1e6, width=32)


def reaching(count: int, radii: list[float], holes: bool = False) -> Reaching:
    """Bodies that lie on random moving ground, which have patches now."""
    rng = np.random.default_rng(count)
    heights = rng.normal(size=(60, 80)).astype(np.float32)
    if holes:
        heights[rng.random(heights.shape) < 0.05] = np.nan
    terrain = Terrain(HeightMap(heights, resolution=0.25, origin=(1.0, -2.0, 0.3), yaw=0.4, velocities=heights * 0.1))
    inner = terrain.tiles[""].geometry.to_world(rng.uniform(10, 50, count), rng.uniform(10, 70, count))
    heights = np.nan_to_num(terrain.at(inner, 0.0).heights) + 0.05
    bodies = balls_on(terrain, np.resize(radii, count).tolist())
    bodies.at(np.column_stack([inner, heights]), 0.01)
    return bodies


def on_a_mesh(count: int) -> Reaching:
    """Bodies on a map and on a mesh beside it."""
    terrain = Terrain(HeightMap(np.zeros((60, 80)), resolution=0.25, origin=(5.0, -2.0, 0.3)))
    terrain.put("rock", TriangleMesh(*mesh_parts.sheet(4.0, 12)))
    bodies = balls_on(terrain, [0.3] * count)
    bodies.at(np.column_stack([np.linspace(-1.0, 9.0, count), np.full((count, 2), 0.2)]), 0.01)
    assert {*bodies.patches.table().tiles} == {"", "rock"}
    return bodies


def xyz(values: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", values, strict=True))


def assert_same(mine: bytes, reference: Any) -> None:
    """Equal as messages and equally long; only padding, which rclpy leaves undefined, may differ."""
    serialised = serialize_message(reference)
    assert deserialize_message(mine, type(reference)) == deserialize_message(serialised, type(reference))
    assert len(mine) == len(serialised)


MADE = [partial(reaching, count, [0.2, 0.4, 0.9], holes) for count in (0, 1, 7, 40) for holes in (False, True)]


@pytest.mark.parametrize("frame", ["map", "a_frame_of_another_length"])
@pytest.mark.parametrize("make", [*MADE, partial(on_a_mesh, 9)])
def test_markers_equal_those_of_message_objects(make: Callable[[], Reaching], frame: str) -> None:
    """And lie on the patches of ~/collider_patches."""
    header, patches = Header(stamp=HEADER.stamp, frame_id=frame), make().patches
    mine = patch_outputs.PatchMarkers().write(header, patches, [f"body_{index}" for index in range(40)], 1)
    message, table = deserialize_message(mine, MarkerArray), patches.table()
    assert [marker.id for marker in message.markers] == table.slots.tolist()
    expected = []
    for index, found in enumerate(message.markers):
        marker = Marker(header=header, ns="patches", id=found.id, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
        marker.frame_locked = True  # shown in any Fixed Frame: RViz takes the newest transform, not the stamp's
        marker.scale, marker.pose.position.z = Vector3(x=1.0, y=1.0, z=1.0), patch_outputs.LIFT
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = patch_outputs.COLOUR
        points, triangles = patch_of(table, index)
        corners = points[triangles]
        known, shown = ({triangle.tobytes() for triangle in part} for part in (corners, corners_of(found)))
        assert shown <= known and shown
        marker.points = [Point(**xyz(corner)) for corner in corners_of(found).reshape(-1, 3).tolist()]
        expected.append(marker)
    assert_same(mine, MarkerArray(markers=expected))


def corners_of(marker: Marker) -> FloatArray:
    return points_of(marker).reshape(-1, 3, 3)


def test_a_body_that_goes_is_deleted_once_and_keeps_its_id_while_it_stays() -> None:
    markers = patch_outputs.PatchMarkers()
    three = markers.write(HEADER, reaching(3, [0.2]).patches, ["a", "b", "c"], 1)
    assert sorted(m.id for m in deserialize_message(three, MarkerArray).markers) == [0, 1, 2]
    two, patches = ["c", "b"], reaching(2, [0.2]).patches
    data = markers.write(HEADER, patches, two, 2)
    after = deserialize_message(data, MarkerArray)
    assert sorted((m.id, m.action) for m in after.markers) == [(0, Marker.DELETE), (1, Marker.ADD), (2, Marker.ADD)]
    assert_same(data, after)
    again = deserialize_message(markers.write(HEADER, patches, two, 2), MarkerArray).markers
    clean = markers.write(HEADER, patches, two, 2, clear=True)
    first, *rest = deserialize_message(clean, MarkerArray).markers
    assert (first.action, first.ns) == (Marker.DELETEALL, "patches")
    assert sorted(m.id for m in rest) == [1, 2] and first.id not in (1, 2), "RViz reports ids that come twice"
    assert sorted((m.id, m.action) for m in again) == [(1, Marker.ADD), (2, Marker.ADD)]


@settings(deadline=None, max_examples=60)
@given(st.lists(names, unique=True, max_size=30), st.booleans())
def test_collider_patches_equal_those_of_message_objects(bodies: list[str], holes: bool) -> None:
    writer = patch_outputs.ColliderPatches()
    writer.write(HEADER, reaching(4, [0.9], True).patches.table(), ["w", "x", "yy", "zzz"], 1)  # its buffer is reused
    table = reaching(len(bodies), [0.2, 0.2, 0.9], holes).patches.table()
    mine = writer.write(HEADER, table, bodies, 2)
    expected = {}
    for index, slot in enumerate(table.slots.tolist()):
        motion = table.motion[index].tolist()
        triangles = [MeshTriangle(vertex_indices=corners.astype(np.uint32)) for corners in patch_of(table, index)[1]]
        expected[bodies[slot]] = ColliderPatch(
            body_id=bodies[slot], row=int(table.rows[index]), column=int(table.columns[index]),
            stride=int(table.stride[index]), deviation=0.0,
            surface_twist=Twist(linear=Vector3(**xyz(motion[:3])), angular=Vector3(**xyz(motion[3:]))),
            mesh=Mesh(triangles=triangles, vertices=[Point(**xyz(p)) for p in patch_of(table, index)[0].tolist()]),
        )  # fmt: skip
    order = [patch.body_id for patch in deserialize_message(mine, ColliderPatchArray).patches]
    assert sorted(order) == sorted(expected)
    if not holes:  # NaN equals nothing
        assert_same(mine, ColliderPatchArray(header=HEADER, patches=[expected[name] for name in order]))


def test_patches_say_whether_they_are_of_a_map_or_a_mesh() -> None:
    data = patch_outputs.ColliderPatches().write(HEADER, on_a_mesh(9).patches.table(), [f"b{k}" for k in range(9)], 1)
    kinds = {patch.kind for patch in deserialize_message(data, ColliderPatchArray).patches}
    assert kinds == {ColliderPatch.HEIGHTFIELD, ColliderPatch.TRIMESH}


def message_of(states: StateTable) -> TrackedBodyArray:
    gravity = np.array(PHYSICS.gravity, np.float32)
    message = TrackedBodyArray(header=HEADER, ahead=0.25, rate=PHYSICS.rate, gravity=gravity)
    for row, v in enumerate(states.numbers.tolist()):
        body = TrackedBody(id=states.names[row], radius=states.radii[row], shape=int(states.kinds[row]))
        body.dimensions, body.centre = states.dimensions[row].astype(np.float32), states.centres[row].astype(np.float32)
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
    message, reader = ArrayMessage(), PeerReader()
    # The second time into the same buffer, where the constant bytes are left as they are, and with known names.
    for turned in (states, states._replace(numbers=table[::-1].copy())):
        expected = message_of(turned)
        assert_same(body_outputs.body_states(message, HEADER, turned, PHYSICS, 0.25), expected)
        read = reader.read(bytes(serialize_message(expected)))
        assert (read.sec, read.nanosec, read.frame_id) == (1234, 567890123, "some_map")
        assert (read.ahead, read.rate, read.gravity) == (0.25, PHYSICS.rate, pytest.approx(PHYSICS.gravity))
        for mine, theirs in zip(read.bodies, turned, strict=True):
            np.testing.assert_array_equal(mine, theirs)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(names, st.tuples(*[numbers] * 8)), max_size=30))
def test_contacts_equal_those_of_message_objects(rows: list[tuple[str, tuple[float, ...]]]) -> None:
    contacts = [GroundContact(name, v[0:3], v[3:6], v[6], v[7]) for name, v in rows]
    mine = body_outputs.contact_array(ArrayMessage(), HEADER, contacts)
    received = deserialize_message(mine, ContactArray)
    messages = [
        Contact(
            body_id=name, position=Point(**xyz(v[:3])), normal=Vector3(**xyz(v[3:6])), depth=v[6], normal_force=v[7]
        )
        for name, v in rows
    ]
    assert sorted(map(str, received.contacts)) == sorted(map(str, messages))
    assert_same(mine, received)


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


@pytest.mark.parametrize("holes", [0.0, 0.05])
@pytest.mark.parametrize(
    ("kind", "message"),
    [(patch_outputs.PatchMarkers, MarkerArray), (patch_outputs.ColliderPatches, ColliderPatchArray)],
)
def test_changes_alone_make_the_same_picture(kind: Any, message: Any, holes: float) -> None:
    """A viewer knows after each incremental message what a full one would tell it."""
    names, rng = [f"body_{index}" for index in range(20)], np.random.default_rng(3)
    heights = rng.normal(scale=0.05, size=(60, 60))
    heights[rng.random(heights.shape) < holes] = np.nan
    terrain = HeightMap(heights, resolution=0.25, motion=MotionConfig(mode="hold"))
    bodies = balls_on(terrain, np.resize([0.2, 0.4, 0.9], 20).tolist())
    places = np.column_stack([rng.uniform(1.0, 14.0, (20, 2)), np.full(20, 0.2)])

    def written(writer: Any, **options: Any) -> Any:
        patches = bodies.patches.table() if message is ColliderPatchArray else bodies.patches
        data = writer.write(HEADER, patches, names, 1, **options)
        made = deserialize_message(data, message)
        assert len(data) == len(serialize_message(made))
        return made

    writer, seen, sizes = kind(), dict[Any, Any](), []
    for turn in range(17):
        moved = rng.random(20) < (0.3 if turn < 16 else 0.0)
        places[moved] += rng.normal(scale=0.3, size=(int(moved.sum()), 3)) * (1.0, 1.0, 3.0)
        if turn % 3 == 0 and turn < 16:
            row, column = rng.integers(0, 50, 2).tolist()
            terrain.update_region(row, column, rng.normal(scale=0.05, size=(9, 9)), time=float(turn))
        bodies.at(places, float(turn))
        changes = written(writer, only_changed=turn not in (0, 5))
        sizes.append(len(getattr(changes, "markers", None) or getattr(changes, "patches", [])))
        keep(seen, changes)
        whole: dict[Any, Any] = {}
        keep(whole, written(kind()))
        assert seen == whole
    assert sizes[-1] == 0, "nothing changed"
    assert len(set(sizes)) > 3
