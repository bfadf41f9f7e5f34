"""What a view takes from messages about bodies, and where the page draws bodies and robots, without a browser."""

import io
import math
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray, PoseWithCovariance
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.testing import pose_message
from tests.urdfs import robot

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

import trimesh

from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.client.sight import KINDS, Pose, Sight
from smartmesh_ros.tools.view.robots import GAP, Robot
from smartmesh_ros.tools.view.scene import Scene

BOX = '<geometry><box size="1 1 0.4"/></geometry>'
LINK = f'<link name="b"><visual>{BOX}</visual></link>'
MESHES = '<link name="b"><visual><geometry><mesh filename="{}"/></geometry></visual><collision>' + BOX
JOINT = '<joint name="j" type="spherical"><origin xyz="0 0 1"/><parent link="b"/><child link="arm"/></joint>'


def at(x: float, y: float, z: float) -> Pose:
    return Pose((x, y, z), (1.0, 0.0, 0.0, 0.0))


def tell(sight: Sight, topic: str, bodies: list[Any], frame: str = "") -> None:
    kind = BodyDescriptionArray if topic == "body_descriptions" else TrackedBodyArray
    sight.take(topic, serialize_message(kind(header=Header(frame_id=frame), bodies=bodies)))


def batches(server: Any, sight: Sight, scene: Scene | None = None) -> list[Any]:
    """What a scene, which may be a new one, draws of bodies that are no robots."""
    (scene or Scene(server)).show(Ground(), sight)
    return [handle for path, handle in server.scene._handle_from_node_name.items() if path.startswith("/bodies/")]


def test_malformed_messages_are_skipped() -> None:
    """Anybody may publish on the topics of the node's inputs, and the node refuses what is malformed."""
    remote = Remote.__new__(Remote)
    remote.ground, remote.sight, remote._new = Ground(), Sight(), {}
    for topic in KINDS:
        remote._new[topic] = deque([serialize_message(TrackedBodyArray(bodies=[TrackedBody(id="a")]))[:-4], b""])
    remote._take("collider_patches", b"")
    remote.apply_waiting()
    assert not remote.sight.poses and not remote.sight.patches


def test_tracked_bodies_of_another_frame_are_not_drawn_where_they_are_not() -> None:
    sight = Sight()
    for topic, frame in (("body_states", "map"), ("tracked_bodies", "odom"), ("tracked_bodies", "/map")):
        tell(sight, topic, [TrackedBody(id=f"{topic} in {frame.strip('/')}")], frame)
    for frame, number in (("map", 2), ("odom", 3)):
        poses = [pose_message((1.0, 2.0, 3.0))] * number
        sight.take("body_poses", serialize_message(PoseArray(header=Header(frame_id=frame), poses=poses)))
    assert sight.poses.keys() == {"body_states in map", "tracked_bodies in map", "body_0", "body_1"}
    assert sight.poses["body_1"].position == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    "spoilt",
    [
        {"id": "b/c"}, {"id": "body_0"}, {"id": "b", "shape": TrackedBody.SHAPE_BOX},
        *({"id": "b", "pose": pose_message((x, 2.0, 3.0))} for x in (math.nan, -math.inf, 1e20)),
    ],
)  # fmt: skip
def test_a_message_that_the_node_refuses_for_one_body_moves_none(spoilt: dict[str, Any]) -> None:
    """A name with a slash, one that is there twice, a box without edges, and poses: the camera that should show them
    ended the view."""
    sight = Sight()
    tell(sight, "tracked_bodies", [TrackedBody(id="body_0", pose=pose_message((1.0, 2.0, 3.0)))])
    with pytest.raises(InputError):
        tell(sight, "tracked_bodies", [TrackedBody(id="body_0"), TrackedBody(**spoilt)])
    if "pose" in spoilt:
        poses = PoseArray(poses=[pose_message((0.0, 0.0, 0.0)), spoilt["pose"]])
        with pytest.raises(InputError):
            sight.take("body_poses", serialize_message(poses))
    assert sight.poses == {"body_0": at(1.0, 2.0, 3.0)}


def test_a_body_that_was_removed_is_not_found_at_its_last_pose() -> None:
    """Also if states of before its removal are read after the descriptions: the view reads the newest of each topic."""
    sight = Sight()
    for names in (("ball", "box"), ("ball",)):
        known = [BodyDescription(id="crate", tracked=True), *(BodyDescription(id=name) for name in names)]
        tell(sight, "body_descriptions", known)
        tell(sight, "tracked_bodies", [TrackedBody(id="crate")])
        tell(sight, "body_states", [TrackedBody(id=name) for name in ("ball", "box")])
    tell(sight, "body_states", [TrackedBody(id="ball")])
    assert sight.poses.keys() == {"ball", "crate"}


@pytest.mark.parametrize(
    ("links", "top"),
    [
        (MESHES.format("box.stl") + "</collision></link>", 0.4),
        (MESHES.format("missing.stl") + "</collision></link>", 0.2),
        (MESHES.format("package://nowhere/missing.stl") + "</collision></link>", 0.2),
        (LINK + JOINT + LINK.replace('"b"', '"arm"'), 1.2),
    ],
    ids=["mesh", "missing mesh", "missing package", "spherical joint"],
)
def test_a_robot_is_drawn_by_its_meshes_and_else_by_its_collision_shapes(
    server: Any, drawn: Any, tmp_path: Path, links: str, top: float
) -> None:
    trimesh.creation.box((1.0, 1.0, 0.8)).export(tmp_path / "box.stl")
    shown = Robot(server, "rover", BodyDescription(urdf=robot(links), urdf_file=str(tmp_path / "robot.urdf")))
    shown.show(Sight(bases={"b": at(0.0, 0.0, 1.0)}))
    assert not shown.fault
    assert drawn["/labels/rover"].position[2] == pytest.approx(1.0 + top + GAP)


def test_links_of_a_robot_without_movable_joints_are_where_its_description_puts_them(server: Any, drawn: Any) -> None:
    """Such as the tracks of a machine, which are fixed to its hull."""
    urdf = robot(LINK + JOINT.replace("spherical", "fixed") + LINK.replace('"b"', '"arm"'))
    Robot(server, "digger", BodyDescription(urdf=urdf)).show(Sight(bases={"b": at(0.0, 0.0, 0.0)}))
    [arm] = [handle for path, handle in drawn.items() if path.endswith("/arm")]
    assert arm.position.tolist() == [0.0, 0.0, 1.0]


def test_a_robot_has_the_colours_of_its_description_in_daylight(server: Any, drawn: Any, tmp_path: Path) -> None:
    """Of a material that another link defines too, and of a mesh's own. Metal would be black without surroundings."""
    shapes = '<box size="1 1 1"/>', '<capsule radius="1" length="2"/>', '<mesh filename="cube.obj"/>'
    red = '<material name="red"><color rgba="1 0 0 1"/></material>', '<material name="red"/>', ""
    links = [
        f'<link name="link_{k}"><visual><geometry>{shapes[k]}</geometry>{red[k]}</visual></link>'
        f'<joint name="joint_{k}" type="fixed"><parent link="base"/><child link="link_{k}"/></joint>'
        for k in range(3)
    ]
    (tmp_path / "cube.obj").write_text("mtllib cube.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "cube.mtl").write_text("newmtl red\nKd 1 0 0\n")
    urdf = robot('<link name="base"/>' + "".join(links))
    assert not Robot(server, "r", BodyDescription(urdf=urdf, urdf_file=str(tmp_path / "robot.urdf"))).fault
    files = [handle.glb_data for handle in drawn.values() if hasattr(handle, "glb_data")]
    assert len(files) == 3
    for data in files:
        material = trimesh.load_mesh(io.BytesIO(data), file_type="glb").visual.material
        assert material.main_color.tolist() == [255, 0, 0, 255] and material.metallicFactor == 0.0


def test_each_robot_is_where_its_own_frame_is_also_when_it_comes_again(server: Any, drawn: Any) -> None:
    """The first has short names, the other prefixed ones, and short ones when it comes again alone. The texts begin as
    those of files may, with space before the declaration, which the node takes."""
    scene, sight = Scene(server), Sight()
    for robots in ({"one": ("b", 3.0), "two": ("two/b", -1.0)}, {"one": ("b", 2.0)}, {"two": ("b", 5.0)}):
        text = "\n<?xml version='1.0'?>" + robot(LINK)
        known = [BodyDescription(id=name, shape=BodyDescription.ROBOT, urdf=text) for name in robots]
        tell(sight, "body_descriptions", known)
        for frame, x in robots.values():
            pose = PoseWithCovariance(pose=pose_message((x, 0.5 * x, 1.0)))
            sight.take("odometry", serialize_message(Odometry(child_frame_id=frame, pose=pose)))
        scene.show(Ground(), sight)
        labels = {handle.text: handle for path, handle in drawn.items() if path.startswith("/labels/")}
        assert labels.keys() == robots.keys()
        for name, (_, x) in robots.items():
            assert labels[name].visible
            assert labels[name].position == pytest.approx((x, 0.5 * x, 1.2 + GAP))


@pytest.mark.parametrize(
    ("urdf", "file", "fault"),
    [("", "/gone.urdf", "its file /gone.urdf is gone from the node"), ("<robot", "", "it is no XML (unclosed")],
)
def test_a_robot_that_cannot_be_drawn_is_the_box_around_its_links_and_the_page_says_why(
    server: Any, drawn: Any, urdf: str, file: str, fault: str
) -> None:
    """Beside its centre of mass, and turned with it. The node describes a robot anew, then without its text, when
    another body comes."""
    sight, scene = Sight(), Scene(server)
    described = BodyDescription(id="r", shape=BodyDescription.ROBOT, urdf=urdf, urdf_file=file)
    tell(sight, "body_descriptions", [described])
    state = TrackedBody(id="r", pose=pose_message((1.0, 2.0, 3.0), 0.5 * math.pi), shape=TrackedBody.SHAPE_BOX)
    state.dimensions, state.centre = [0.5, 0.25, 1.0], [0.25, 0.0, 0.5]
    tell(sight, "body_states", [state])
    [box] = batches(server, sight, scene)
    np.testing.assert_allclose(box.batched_positions, [[1.0, 2.25, 3.5]], atol=1e-6)
    assert np.ptp(box.vertices, axis=0).tolist() == [0.5, 0.25, 1.0]
    assert drawn["/labels/r"].visible
    [words] = scene.faults
    assert words.startswith("r is drawn as a box: ") and fault in words


def test_bodies_of_nearly_the_same_size_are_all_drawn(server: Any) -> None:
    sizes = {"one": 0.25, "two": 0.2500001}
    appearances = {name: BodyDescription(shape=BodyDescription.SPHERE, dimensions=[r]) for name, r in sizes.items()}
    assert len(batches(server, Sight(poses=dict.fromkeys(sizes, at(0.0, 0.0, 0.0)), appearances=appearances))) == 2
