"""Descriptions over DDS: of robots, refused whole, whichever way they come, and prepared while the physics steps; and
``~/body_descriptions``, which tells what every body looks like, also to whoever listens late."""

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, BodySpecification
from smartmesh_msgs.srv import RemoveBody, SpawnBodies, SpawnBody
from std_msgs.msg import String

from smartmesh_ros.node.services.files import robot_name
from smartmesh_ros.tools.testing import Probe
from tests.node.shared import BALL, LATCHED, body_names, box, refusals, show_level_ground, spawn
from tests.urdfs import ROVER, joint, link, robot

SHARED = {"bodies.urdf_folders": [tempfile.gettempdir()]}
REFUSED = {
    "two roots": (robot(link("a"), link("b")), "2 links have no parent"),
    "a mesh of another kind": (robot(link("a", '<mesh filename="{folder}/part.glb"/>')), "part.glb"),
    "a package that is not there": (
        robot(link("a", '<mesh filename="package://no_such_pkg/m.stl"/>')), "'no_such_pkg' is not installed",
    ),
}  # fmt: skip


def test_a_refused_robot_changes_nothing_whichever_way_it_comes(probe: Probe, tmp_path: Path) -> None:
    """The robot of the topic stays, the refused name is free, and the node runs."""
    (tmp_path / "part.glb").write_bytes(b"glTF")
    parameters = {"bodies.urdf_folders": [str(tmp_path)], "robot.start": "{id: good, xy: [0, 0], above: 0.5}"}
    with probe.running(parameters=parameters) as process:
        topic = probe.publisher(String, "robot_description", LATCHED)
        show_level_ground(probe)
        topic.publish(String(data=robot(link("base"))))

        probe.wait_for(lambda: body_names(probe) == ["good"])
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
        assert body_names(probe) == ["good"]
        # The same description again is of the robot that is there; once it was removed, it is of a new one.
        for _ in range(2):
            topic.publish(String(data=robot(link("base"))))
            probe.wait_for(lambda: body_names(probe) == ["good"])
            assert probe.call("remove_body", RemoveBody, id="good").success
            probe.wait_for(lambda: body_names(probe) == [])
        topic.publish(String(data=robot(link("base"))))
        probe.wait_for(lambda: body_names(probe) == ["good"])
        spawn(probe, "bad")
        probe.wait_for(lambda: body_names(probe) == ["good", "bad"])
        assert process.process.poll() is None


def test_space_before_the_xml_declaration_is_skipped(shared: Probe) -> None:
    text = "\n \n" + '<?xml version="1.0"?>' + robot(link("a"))
    assert robot_name(text) == "r"
    spawn(shared, "by_service", urdf=text)
    shared.publisher(String, "robot_description", LATCHED).publish(String(data=text))
    show_level_ground(shared)
    shared.wait_for(lambda: {"by_service", "robot"} <= set(body_names(shared)))


def test_the_packages_of_a_file_are_found_as_those_of_a_text(
    probe: Probe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = tmp_path / "install/share"
    index = share / "ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (share / "my_robot/my meshes").mkdir(parents=True)
    (index / "my_robot").touch()
    part = share / "my_robot/my meshes/part.obj"
    part.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    text = robot(link("a", '<mesh filename="package://my_robot/my%20meshes/part.obj"/>'))
    seen = '<visual><geometry><mesh filename="package://no_such_pkg/x.dae"/></geometry></visual><collision>'
    file = tmp_path / "my robot.urdf"
    file.write_text(text.replace("<collision>", seen))
    local = f"file://localhost{file}".replace(" ", "%20")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{os.environ['AMENT_PREFIX_PATH']}:{share.parent}")
    parameters = {
        "bodies.urdf_folders": [str(tmp_path)], "robot.description": str(file),
        "robot.start": "{id: robot, xy: [0, 0], above: 1.0}",
        "bodies.spawn": [f"{{id: spawned, urdf: {file}, xy: [4, 4], align: true}}"],
    }  # fmt: skip
    with probe.running(parameters=parameters) as process:
        show_level_ground(probe, 100)
        for name, urdf in (("text", text), ("path", str(file)), ("uri", f"file://{file}"), ("local", local)):
            spawn(probe, name, (2.0, 2.0, 9.0), urdf=urdf)
        wanted = {"robot", "spawned", "text", "path", "uri", "local"}
        probe.wait_for(lambda: set(body_names(probe)) == wanted)
        part.rename(part.with_name("other.obj"))
        answer = probe.call("spawn_body", SpawnBody, id="late", urdf=str(file))
        assert not answer.success and "package://my_robot/my%20meshes/part.obj" in answer.message
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
    links = [link(f"l{k}", f'<mesh filename="{tmp_path}/hull_{k}.obj"/>') for k in range(3)]
    joints = [joint(f"j{k}", "fixed", "l0", f"l{k}") for k in (1, 2)]
    client = shared.client("spawn_body", SpawnBody)
    request = SpawnBody.Request(id="robot", urdf=robot(*links, *joints), on_ground=True)
    request.pose.position.x = request.pose.position.y = 5.0
    states = shared.received[shared.topic("body_states")]
    before = len(states)
    answer = client.call_async(request)
    shared.wait_for(answer.done)
    assert answer.result().success, answer.result().message
    assert len(states) - before > 5


CAPSULE = "{id: pill, shape: capsule, size: [0.4, 0.1], mass: 1.0, xyz: [3, 0, 1]}"


def described(messages: list[Any]) -> dict[str, BodyDescription]:
    return {body.id: body for body in messages[-1].bodies} if messages else {}


def test_every_body_is_described_while_it_is_there(probe: Probe) -> None:
    file = Path(pybullet_data.getDataPath()) / "r2d2.urdf"
    with probe.running(parameters={"bodies.spawn": [CAPSULE, f"{{id: robot, urdf: {file}, xyz: [0, 4, 1]}}"]}):
        probe.publish_map(np.zeros((41, 41)), resolution=0.25, origin=(-5.0, -5.0, 0.0))
        messages = probe.listen("body_descriptions", BodyDescriptionArray, LATCHED)
        can = SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.8, 0.3])
        spawn(probe, "box", (0, 0, 2), shape=box(0.2, 0.4, 0.6))
        spawn(probe, "can", (0, 0, 2), shape=can)
        text = Path(ROVER).read_text()
        spawn(probe, "rover", (-2, 0, 1), urdf=text)

        def all_are_described() -> bool:
            probe.publish_bodies({"guest": (2.0, 2.0, 1.0)}, radius=0.7)  # it goes if no pose comes for a second
            return described(messages).keys() == {"pill", "robot", "box", "can", "rover", "guest"}

        probe.wait_for(all_are_described)
        found = described(messages)
        assert (found["box"].shape, list(found["box"].dimensions)) == (BodyDescription.BOX, [0.2, 0.4, 0.6])
        assert (found["can"].shape, list(found["can"].dimensions)) == (BodyDescription.CYLINDER, [0.8, 0.3])
        assert (found["pill"].shape, list(found["pill"].dimensions)) == (BodyDescription.CAPSULE, [0.4, 0.1])
        rover = found["rover"]
        assert (rover.shape, rover.urdf, rover.urdf_file) == (BodyDescription.ROBOT, text, "")
        assert (found["robot"].urdf, found["robot"].urdf_file) == (file.read_text(), str(file))
        assert found["guest"].tracked
        assert np.allclose(found["guest"].dimensions, 0.7)
        with Probe() as late:
            seen = late.listen(probe.topic("body_descriptions"), BodyDescriptionArray, LATCHED)
            late.wait_for(lambda: {"box", "rover"} <= described(seen).keys())
        assert probe.call("remove_body", RemoveBody, id="box").success
        probe.wait_for(lambda: described(messages) and "box" not in described(messages))
