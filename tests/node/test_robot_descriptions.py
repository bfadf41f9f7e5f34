"""Robot descriptions over DDS: refused whole, whichever way they come, and prepared while the physics steps."""

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import SpawnBodies, SpawnBody
from std_msgs.msg import String

from smartmesh_ros.node.services.robot_files import robot_name
from smartmesh_ros.tools.testing import Probe
from tests.node.shared import BALL, LATCHED, refusals, show_level_ground, spawn

SHARED = {"bodies.urdf_folders": [tempfile.gettempdir()]}
LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>'
    "</inertial><collision><geometry>{1}</geometry></collision></link>"
)
BALL_XML = '<sphere radius="0.1"/>'


def described(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


REFUSED = {
    "two roots": (described(LINK.format("a", BALL_XML), LINK.format("b", BALL_XML)), "2 links have no parent"),
    "raw Xacro": (described(LINK.format("a", '<sphere radius="${radius}"/>')), "Xacro"),
    "Xacro elements": ("<robot><xacro:include/></robot>", "Xacro"),
    "a floating joint": (
        described(
            LINK.format("a", BALL_XML), LINK.format("b", BALL_XML),
            '<joint name="free" type="floating"><parent link="a"/><child link="b"/></joint>',
        ), "'free' is floating",
    ),
    "a mesh of another kind": (described(LINK.format("a", '<mesh filename="{folder}/part.glb"/>')), "part.glb"),
    "a package that is not there": (
        described(LINK.format("a", '<mesh filename="package://no_such_pkg/m.stl"/>')), "'no_such_pkg' is not installed",
    ),
}  # fmt: skip


def test_a_refused_robot_changes_nothing_whichever_way_it_comes(probe: Probe, tmp_path: Path) -> None:
    """The robot of the topic stays, the refused name is free, and the node runs."""
    (tmp_path / "part.glb").write_bytes(b"glTF")
    with probe.running(parameters={"bodies.urdf_folders": [str(tmp_path)], "robot.name": "good"}) as process:
        topic = probe.publisher(String, "robot_description", LATCHED)
        show_level_ground(probe)
        topic.publish(String(data=described(LINK.format("base", BALL_XML))))

        def names() -> list[str]:
            return [body.id for body in probe.latest("body_states").bodies]

        probe.wait_for(lambda: names() == ["good"])
        for kind, (text, words) in REFUSED.items():
            urdf = text.replace("{folder}", str(tmp_path))
            answer = probe.call("spawn_body", SpawnBody, id="bad", urdf=urdf)
            assert not answer.success and words in answer.message, kind
            ball = BodySpecification(id="bad_ball", mass=1.0, shape=BALL)
            both = [ball, BodySpecification(id="bad", urdf=urdf)]
            batch = probe.call("spawn_bodies", SpawnBodies, bodies=both)
            assert [failure.id for failure in batch.failures] == ["bad"], kind
            seen = refusals(probe)
            topic.publish(String(data=urdf))
            probe.wait_for(lambda seen=seen: refusals(probe) > seen)
        assert names() == ["good"]
        spawn(probe, "bad")
        probe.wait_for(lambda: names() == ["good", "bad"])
        assert process.process.poll() is None


def test_space_before_the_xml_declaration_is_skipped(shared: Probe) -> None:
    text = "\n \n" + '<?xml version="1.0"?>' + described(LINK.format("a", BALL_XML))
    assert robot_name(text) == "r"
    spawn(shared, "by_service", urdf=text)
    shared.publisher(String, "robot_description", LATCHED).publish(String(data=text))
    show_level_ground(shared)
    shared.wait_for(lambda: {"by_service", "robot"} <= {body.id for body in shared.latest("body_states").bodies})


def test_the_packages_of_a_file_are_found_as_those_of_a_text(
    probe: Probe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = tmp_path / "install/share"
    index = share / "ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (share / "my_robot").mkdir()
    (index / "my_robot").touch()
    (share / "my_robot/part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    text = described(LINK.format("a", '<mesh filename="package://my_robot/part.obj"/>'))
    seen = '<visual><geometry><mesh filename="package://no_such_pkg/x.dae"/></geometry></visual><collision>'
    file = tmp_path / "robot.urdf"
    file.write_text(text.replace("<collision>", seen))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{os.environ['AMENT_PREFIX_PATH']}:{share.parent}")
    parameters = {
        "bodies.urdf_folders": [str(tmp_path)], "robot.description": str(file), "robot.above": 1.0,
        "bodies.spawn": [f"{{id: spawned, urdf: {file}, xy: [4, 4], align: true}}"],
    }  # fmt: skip
    with probe.running(parameters=parameters) as process:
        show_level_ground(probe, 100)
        for name, urdf in (("text", text), ("path", str(file)), ("uri", f"file://{file}")):
            spawn(probe, name, (2.0, 2.0, 9.0), urdf=urdf)
        wanted = {"robot", "spawned", "text", "path", "uri"}
        probe.wait_for(lambda: {body.id for body in probe.latest("body_states").bodies} == wanted)
        (share / "my_robot/part.obj").rename(share / "my_robot/other.obj")
        answer = probe.call("spawn_body", SpawnBody, id="late", urdf=str(file))
        assert not answer.success and "package://my_robot/part.obj" in answer.message
        assert "WARN" in process.output


def test_the_physics_steps_while_a_robot_is_prepared_and_put_onto_the_ground(shared: Probe, tmp_path: Path) -> None:
    """Hulls of thousands of vertices take a second; the states of another body go on arriving meanwhile."""
    show_level_ground(shared, 100)
    spawn(shared, "ball", (2.0, 2.0, 0.0), on_ground=True)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(6000, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1, keepdims=True)
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {k} {k + 1} {k + 2}" for k in range(1, 5998, 3)]
    for number in range(3):  # distinct meshes, each of which is read
        (tmp_path / f"hull_{number}.obj").write_text("\n".join([*lines, f"v 0 0 {0.3 + 0.1 * number}", "f 1 2 6001"]))
    links = [LINK.format(f"l{k}", f'<mesh filename="{tmp_path}/hull_{k}.obj"/>') for k in range(3)]
    joints = [f'<joint name="j{k}" type="fixed"><parent link="l0"/><child link="l{k}"/></joint>' for k in (1, 2)]
    client = shared.client("spawn_body", SpawnBody)
    request = SpawnBody.Request(id="robot", urdf=described(*links, *joints), on_ground=True)
    request.pose.position.x = request.pose.position.y = 5.0
    states = shared.received[shared.topic("body_states")]
    before = len(states)
    answer = client.call_async(request)
    shared.wait_for(answer.done)
    assert answer.result().success, answer.result().message
    assert len(states) - before > 5
