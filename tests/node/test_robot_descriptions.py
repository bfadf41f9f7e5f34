"""Descriptions over DDS: of robots, refused whole, whichever way they come, and prepared while the physics steps; and
``~/body_descriptions``, which tells what every body looks like, also to whoever listens late."""

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBody, SpawnBody
from std_msgs.msg import String

from smartmesh_ros import BodyState
from smartmesh_ros.node.services.files import allowed_folders
from smartmesh_ros.tools.testing import Probe, pose_message
from tests.node.shared import LATCHED, Logged, body_names, box, fed, on_level, refusals, show_level_ground, spawn
from tests.urdfs import ROVER, joint, link, mesh, robot

SHARED = {"bodies.urdf_folders": [tempfile.gettempdir()]}


def test_a_refused_robot_changes_nothing_whichever_way_it_comes(probe: Probe) -> None:
    """The robot of the topic, which was latched before there was a node, stays; the refused name is free. What else is
    refused: tests/world/test_robot_descriptions.py and test_robot_meshes.py."""
    urdf = robot(link("a", mesh("package://no_such_pkg/m.stl")))
    topic = probe.node.create_publisher(String, probe.topic("robot_description"), LATCHED)
    topic.publish(String(data=robot(link("base"))))
    with probe.running(parameters={"robot.start": ["{id: good, xy: [0, 0], above: 0.5}"]}):
        show_level_ground(probe)
        probe.wait_for(lambda: body_names(probe) == ["good"])
        answer = probe.call("spawn_body", SpawnBody, id="bad", urdf=urdf)
        assert not answer.success and "'no_such_pkg' is not installed" in answer.message
        topic.publish(String(data=urdf))
        probe.wait_for(lambda: refusals(probe)["robot_description: urdf_package"])
        spawn(probe, "bad")
        probe.wait_for(lambda: body_names(probe) == ["good", "bad"])


def test_a_description_is_of_the_robot_that_is_there_or_of_a_new_one_in_its_place() -> None:
    start = {"robot.start": ["{id: rover, xy: [4.0, 4.0], above: 0.25, yaw: 2.1}"]}
    text = Path(ROVER).read_text()
    with on_level(start) as run:

        def describe(what: str) -> BodyState:
            run.give("robot_description", String(data=what))
            run.run(run.time + 1.0)
            return run.world.state("rover")

        # A byte order mark, which editors on Windows write, and space before the XML declaration are skipped.
        place = describe("\ufeff\n \n" + text).position
        assert describe(text).position == pytest.approx(place, abs=1e-3)
        assert describe(str(ROVER)).position == pytest.approx(place, abs=1e-3)
        assert run.refused == {"robot_description: urdf": 1}, "a path"
        mass = run.world.bodies["rover"].mass
        assert describe(text.replace('"10.0"', '"20.0"')).position == pytest.approx(place, abs=0.02)
        assert run.world.bodies["rover"].mass == pytest.approx(mass + 10.0)
        assert run.call("remove_body", RemoveBody.Request(id="rover")).success
        assert describe(text).position == pytest.approx(place, abs=0.02), "a new one"


def test_files_are_found_in_packages_and_at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever names them: parameters, services, and descriptions as files or texts."""
    share = tmp_path / "install/share"
    index = share / "ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (share / "my_robot/my meshes").mkdir(parents=True)
    (index / "my_robot").touch()
    part = share / "my_robot/my meshes/part.obj"
    part.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    text = robot(link("a", mesh("package://my_robot/my%20meshes/part.obj")))
    seen = '<visual><geometry><mesh filename="package://no_such_pkg/x.dae"/></geometry></visual><collision>'
    file = tmp_path / "my robot.urdf"
    file.write_text(text.replace("<collision>", seen))
    local = f"file://localhost{file}".replace(" ", "%20")
    np.save(share / "my_robot/far hill.npy", np.full((5, 5), 7.0))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{os.environ['AMENT_PREFIX_PATH']}:{share.parent}")
    monkeypatch.setenv("HOME", str(tmp_path))
    parameters = {
        "bodies.urdf_folders": ["package://my_robot", "~"], "robot.description": "~/my robot.urdf",
        "robot.start": ["{id: robot, xy: [0, 0], above: 1.0}"],
        "bodies.spawn": ["{id: spawned, urdf: ~/my robot.urdf, xy: [4, 4], align: true}"],
        "bodies.shapes": ["{body: seen, urdf: '~/my robot.urdf'}"],
        "terrain.file": "package://my_robot/far%20hill.npy", "raster.origin": [100.0, 0.0, 0.0],
    }  # fmt: skip
    with on_level(parameters) as run:
        assert run.world.terrain.at([(100.2, 0.2)], 0.0).heights == pytest.approx(7.0)
        run.run(0.1)
        given = {"text": text, "path": str(file), "uri": f"file://{file}", "local": local, "home": f"~/{file.name}"}
        for name, urdf in given.items():
            answer = run.call("spawn_body", SpawnBody.Request(id=name, urdf=urdf, pose=pose_message((2.0, 2.0, 9.0))))
            assert answer.success, answer.message
        assert run.world.bodies.keys() == {"robot", "spawned", *given}
        part.rename(part.with_name("other.obj"))
        answer = run.call("spawn_body", SpawnBody.Request(id="late", urdf=str(file)))
        assert not answer.success and "package://my_robot/my%20meshes/part.obj" in answer.message
        assert any("WARN" in line for line in run.log)


def test_the_physics_steps_while_a_robot_is_prepared_and_put_onto_the_ground(shared: Probe, tmp_path: Path) -> None:
    """Hulls of thousands of vertices take a second; the states of another body go on arriving meanwhile."""
    show_level_ground(shared, 100)
    spawn(shared, "ball", (2.0, 2.0, 0.0), on_ground=True)
    points = np.random.default_rng(0).normal(size=(6000, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1, keepdims=True)
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {k} {k + 1} {k + 2}" for k in range(1, 5998, 3)]
    for number in range(3):  # distinct meshes, each of which is read
        (tmp_path / f"hull_{number}.obj").write_text("\n".join([*lines, f"v 0 0 {0.3 + 0.1 * number}", "f 1 2 6001"]))
    links = [link(f"l{k}", mesh(tmp_path / f"hull_{k}.obj")) for k in range(3)]
    joints = [joint(f"j{k}", "fixed", "l0", f"l{k}") for k in (1, 2)]
    before = len(states := shared.received[shared.topic("body_states")])
    spawn(shared, "robot", (5.0, 5.0, 0.0), urdf=robot(*links, *joints), on_ground=True)
    assert len(states) - before > 5


def test_every_body_is_described_while_it_is_there() -> None:
    """Also when somebody listens late: the next test. All shapes: test_conversions.py."""
    file, text = Path(pybullet_data.getDataPath()) / "r2d2.urdf", Path(ROVER).read_text()
    given = {"bodies.spawn": [f"{{id: robot, urdf: {file}, xyz: [0, 4, 1]}}"], "bodies.timeout": 60.0}
    with on_level(given, keep=["body_descriptions"]) as run:

        def described() -> dict[str, BodyDescription]:
            run.run(run.time + 1.0)
            return {body.id: body for body in run.received("body_descriptions")[-1].bodies}

        assert run.call("spawn_body", SpawnBody.Request(id="box", shape=box(0.2, 0.4, 0.6), mass=1.0)).success
        assert run.call("spawn_body", SpawnBody.Request(id="rover", urdf=text)).success
        run.give("tracked_bodies", TrackedBodyArray(bodies=[TrackedBody(id="guest", radius=0.7)]))
        found = described()
        assert found.keys() == {"box", "robot", "rover", "guest"}
        assert (found["box"].shape, [*found["box"].dimensions]) == (BodyDescription.BOX, [0.2, 0.4, 0.6])
        rover, guest = found["rover"], found["guest"]
        assert (rover.shape, rover.urdf, rover.urdf_file) == (BodyDescription.ROBOT, text, "")
        assert (found["robot"].urdf, found["robot"].urdf_file) == (file.read_text(), str(file))
        assert guest.tracked and guest.dimensions[0] == pytest.approx(0.7)
        assert run.call("remove_body", RemoveBody.Request(id="box")).success
        assert described().keys() == found.keys() - {"box"}


def test_whoever_listens_late_hears_of_no_body_that_is_gone(shared: Probe) -> None:
    """Also if nobody listened when it went."""
    show_level_ground(shared)
    topic = shared.topic("body_descriptions")

    def first_heard() -> list[str]:
        messages: list[BodyDescriptionArray] = []
        subscription = shared.node.create_subscription(BodyDescriptionArray, topic, messages.append, LATCHED)
        shared.wait_for(lambda: messages)
        shared.node.destroy_subscription(subscription)
        shared.wait_for(lambda: not shared.node.count_subscribers(topic))
        return [body.id for body in messages[0].bodies]

    for name in ("old", "new"):
        spawn(shared, name, (2.0, 2.0, 0.5))
        for _ in range(2):  # longer than the period of what is latched
            shared.diagnostics("bodies")
        assert first_heard() == [name]
        assert shared.call("remove_body", RemoveBody, id=name).success


def test_folders_that_do_not_exist_are_named(tmp_path: Path, logged: Logged) -> None:
    """At the start, and when they are set; one that is made later counts from then on, and ``~`` is one's home. That of
    a user who is not there is one that is not there."""
    gone = str(tmp_path / "gone")
    with fed({"bodies.urdf_folders": [gone, "~", "~nobody_here/robots"]}) as node:
        said = logged()
        assert f"no folder {gone};" in said and said.count("there is no folder") == 2
        assert not node.set("bodies.urdf_folders", [str(tmp_path), f"{gone}er", "~nobody_here"])
        said = logged()
        assert f"no folder {gone}er;" in said and said.count("there is no folder") == 2
        assert allowed_folders(replace(node.node.settings, urdf_folders=("~/robots",))) == (Path.home() / "robots",)
