"""Robot descriptions: refused as a whole with a reason, or simulated as URDF means them; those from peers are kept to
their folders, and to numbers that can be simulated."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from smartmesh_ros import BodyState, InputError, JointCommand, Sphere, World
from smartmesh_ros.io.urdf import checked_urdf
from smartmesh_ros.world.robots.prepared import prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP
from tests.node.shared import wait_until
from tests.preloaded import has_ended
from tests.urdfs import joint, link, mesh, robot

A, B, C = link("a"), link("b"), link("c")
AB, BC, AC = (joint(f"{p}{c}", "fixed", p, c) for p, c in ("ab", "bc", "ac"))


def hinge(more: str = "", axis: str = "0 1 0") -> str:
    return joint("ab", "continuous", "a", "b", more, axis=axis)


BROKEN = {
    "two roots": (robot(A, B), "'a', 'b'"),
    "one link apart": (robot(A, B, C, AB), "'a', 'c'"),
    "a joint's name twice": (robot(A, B, C, AB, AC.replace("ac", "ab")), "2 joints are named 'ab'"),
    "a link's name twice": (robot(A, A, B, AB), "2 links are named 'a'"),
    "a link with two parents": (robot(A, B, C, AB, BC, AC), "'c' is the child of joints 'bc' and 'ac'"),
    "a closed loop": (robot(A, B, AB, joint("ba", "fixed", "b", "a")), "no parent|ancestor"),
    "a loop beside the tree": (robot(A, B, C, BC, joint("cb", "fixed", "c", "b")), "ancestor"),
    "a joint without type": (robot(A, B, joint("ab", "", "a", "b")), "'ab' has no type"),
    "a joint of unknown type": (robot(A, B, joint("ab", "hinge", "a", "b")), "'ab' has the type 'hinge'"),
    "a floating joint": (robot(A, B, joint("ab", "floating", "a", "b")), "'ab' is floating"),
    "a parent that is not there": (robot(A, B, joint("xb", "fixed", "x", "b")), "link 'x', which does not exist"),
    "a joint without child": (robot(A, B, AB.replace('<child link="b"/>', "")), "0 elements <child>"),
    "a link without name": (robot(A.replace(' name="a"', "")), "a link of the URDF has no name"),
    "no link": (robot(), "no link"),
    "a joint without name": (robot(A, B, AB.replace(' name="ab"', "")), "a joint of the URDF has no name"),
    "a name longer than PyBullet's field": (robot(link("a" * 3000)), "3000 characters"),
    "an axis of zero": (robot(A, B, hinge(axis="0 0 0")), "the axis of joint 'ab' is zero"),
    "a box of two edges": (robot(link("a", '<box size="1 1"/>')), "3 numbers"),
    "a sphere without radius": (robot(link("a", "<sphere/>")), "must be a number"),
    "a shape of no kind": (robot(link("a", '<cone radius="1"/>')), "<cone>"),
    "a collision without geometry": (robot(link("a", "")[:-7] + "<collision/></link>"), "nothing"),
    "a mass that is no number": (robot(A.replace('value="1.0"', 'value="heavy"')), "mass"),
    "an inertia of two moments": (robot(A.replace('ixx="0.02" ', "")), "ixx of .*inertia of link 'a'"),
    "numbers without spaces": (
        robot(A, B, joint("ab", "fixed", "a", "b", xyz="0,0,0.3")), "origin of joint 'ab' is '0,0,0.3'.*with spaces",
    ),
    "an axis of two numbers": (robot(A, B, hinge(axis="0 1")), "xyz of the axis of joint 'ab' is '0 1'.*3 numbers"),
    "a mesh of no package": (robot(link("a", mesh("package:///meshes/a.stl"))), "names no package.*package://<package>"),
    "a mesh found by Xacro": (robot(link("a", mesh("$(find r)/a.stl"))), r"Xacro \('\$\(find r\)/a.stl'\)"),
    "no inertia": (robot('<link name="a"><inertial><mass value="1"/></inertial></link>'), "<inertia"),
    "no shape": (robot(link("a", "")), "no collision shape"),
    "no XML": ("<robot", "no XML"),
    "SDF": ("<sdf/>", "<sdf>"),
    "a Xacro expression": (robot(link("a", '<sphere radius="${radius}"/>')), r"Xacro \('\$\{radius\}'\)"),
    "Xacro elements": (
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:base/></robot>', "Xacro .*xacro:base",
    ),
    "Xacro elements without their name space": (robot(A, "<xacro:base/>"), "Xacro"),
    "a revolute joint without limit": (
        robot(A, B, joint("ab", "revolute", "a", "b")), "'ab' is revolute and has no <limit>.*continuous",
    ),
    "negative damping": (robot(A, B, hinge('<dynamics damping="-1"/>')), "'ab' is negative"),
    "a mimic of no joint": (robot(A, B, hinge('<mimic joint="x"/>')), "'ab' mimics 'x'"),
    "a mimic of itself": (
        robot(A, B, C, hinge('<mimic joint="bc"/>'), joint("bc", "continuous", "b", "c", '<mimic joint="ab"/>')),
        "mimics itself",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_a_refused_robot_leaves_the_world_as_it_was(world: World, kind: str) -> None:
    urdf, words = BROKEN[kind]
    good = robot(A)
    world.spawn_robot("good", good, BodyState((0.0, 0.0, 0.2)))
    bodies, state = world.client.getNumBodies(), world.state("good")
    saved = world.snapshot()
    bad = replace(saved, bodies=(replace(saved.bodies[0], urdf=urdf),))
    for add in (
        lambda: world.spawn_robot("bad", urdf, BodyState((1.0, 0.0, 1.0))),
        lambda: world.spawn_robot("bad", urdf, BodyState((1.0, 0.0, 1.0)), on_ground=True),
        lambda: world.replace_robot("good", urdf),
        lambda: world.restore(bad),
    ):
        with pytest.raises(InputError, match=words):
            add()
        assert list(world.bodies) == ["good"]
        assert world.client.getNumBodies() == bodies
        assert world.followers.names == ["good/a"]
        assert world.state("good") == state
    world.spawn("bad", Sphere(0.1), 1.0, BodyState((1.0, 0.0, 0.1)))
    world.step(10)
    assert world.state("bad").position[2] == pytest.approx(0.1, abs=1e-3)


def test_a_description_in_one_line_is_read_as_one_in_many(world: World) -> None:
    """PyBullet breaks long lines wherever its buffer ends, also within a number."""
    masses = [1.0 + k / 7.0 for k in range(150)]
    links = [link(f"l{k}", mass=mass) for k, mass in enumerate(masses)]
    world.spawn_robot("robot", robot(*links, *(joint(f"j{k}", "fixed", "l0", f"l{k}") for k in range(1, 150))))
    uid = world.bodies["robot"].uid
    found = {
        world.client.getJointInfo(uid, k)[12].decode(): world.client.getDynamicsInfo(uid, k)[0] for k in range(149)
    }
    assert found == pytest.approx({f"l{k}": mass for k, mass in enumerate(masses) if k})


def test_a_loader_that_crashes_or_hangs_refuses_the_robot(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    for code in ("import os; os.kill(os.getpid(), 11)", "import time; time.sleep(1000)"):
        monkeypatch.setattr("smartmesh_ros.world.robots.workshop._START", code)
        monkeypatch.setattr("smartmesh_ros.world.robots.workshop.PATIENCE", 0.5)
        WORKSHOP.close()
        with pytest.raises(InputError, match="crashes or hangs"):
            world.spawn_robot("r", robot(link("a", '<sphere radius="0.123"/>')))
    monkeypatch.undo()
    world.spawn_robot("r", robot(link("a", '<sphere radius="0.123"/>')))


@pytest.mark.parametrize("ending", ["WORKSHOP.close()", "os.kill(WORKSHOP._child.pid, 11)", ""])
def test_no_file_is_left_whether_the_child_is_ended_or_crashes_or_goes_on(ending: str, tmp_path: Path) -> None:
    script = (
        "import os; from smartmesh_ros.world.robots.prepared import prepare_robot; from smartmesh_ros.world.robots."
        f"workshop import WORKSHOP; prepare_robot({robot(A)!r}); print(WORKSHOP._child.pid); {ending}"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    child = subprocess.run([sys.executable, "-c", script], env=environment, stdout=subprocess.PIPE, check=True).stdout
    wait_until(lambda: has_ended(int(child)))
    assert not [*tmp_path.iterdir()]


def test_the_child_ends_with_its_parent_and_a_known_robot_needs_none(world: World) -> None:
    script = (
        "from smartmesh_ros.world.robots.prepared import prepare_robot; from smartmesh_ros.world.robots.workshop "
        f"import WORKSHOP; prepare_robot({robot(A)!r}); print(WORKSHOP._child.pid, flush=True); input()"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert not has_ended(child)
        parent.kill()
        parent.wait()
        wait_until(lambda: has_ended(child))
    first = prepare_robot(robot(B))
    WORKSHOP.close()
    assert prepare_robot(robot(B) + "\n").files == first.files


@pytest.mark.parametrize(
    "visual", [mesh("none.glb"), mesh("/no/such.stl"), '<box size="0 0 0"/>', "", '<cone radius="nan"/>'],
)  # fmt: skip
def test_visuals_never_matter(world: World, visual: str) -> None:
    seen = f'<visual><origin xyz="nan 0 0"/><geometry>{visual}</geometry></visual><collision>'
    world.spawn_robot("r", robot(A.replace("<collision>", seen)), BodyState((0.0, 0.0, 0.1)))
    world.step(10)
    assert world.state("r").position[2] == pytest.approx(0.1, abs=1e-3)


LIMIT = '<limit lower="-1" upper="1" effort="20" velocity="5"/>'


def positions_of(world: World) -> dict[str, float]:
    return {reading.name: reading.position for reading in world.joints("r")}


def test_a_fixed_joint_mimics_nothing() -> None:
    """As in a robot with a locked hand."""
    hand = robot(A, B, C, joint("ab", "continuous", "a", "b"), joint("bc", "fixed", "b", "c", '<mimic joint="ab"/>'))
    assert prepare_robot(hand).mimics == ()


@pytest.mark.parametrize(
    ("kinds", "parent", "multiplier", "offset"),
    [
        (("prismatic", "prismatic"), "base", -1.0, 0.0), (("revolute", "revolute"), "base", 2.0, 0.1),
        (("revolute", "continuous"), "left", -1.0, 0.0), (("revolute", "prismatic"), "base", 0.5, -0.05),
        (("prismatic", "revolute"), "base", 0.0, 0.2),
    ],
)  # fmt: skip
def test_a_joint_that_mimics_another_follows_it(
    world: World, kinds: tuple[str, str], parent: str, multiplier: float, offset: float
) -> None:
    more = f'{LIMIT}<mimic joint="left_joint" multiplier="{multiplier}" offset="{offset}"/>'
    urdf = robot(
        link("base", '<box size="0.4 0.4 0.2"/>', 5.0), link("left", "", 0.1), link("right", "", 0.1),
        joint("left_joint", kinds[0], "base", "left", LIMIT), joint("right_joint", kinds[1], parent, "right", more),
    )  # fmt: skip
    world.note = (said := []).append
    world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 0.1)))
    assert "'right_joint' follows 'left_joint'" in str(said)
    assert positions_of(world) == {"left_joint": 0.0, "right_joint": pytest.approx(offset)}
    for target in (0.03, -0.4):
        world.command("r", "left_joint", JointCommand(position=target))
        for count in (60, 300):
            world.step(count)
            positions = positions_of(world)
            follows = multiplier * positions["left_joint"] + offset
            assert positions["right_joint"] == pytest.approx(follows, abs=5e-3)
        assert positions["left_joint"] == pytest.approx(target, abs=5e-3)
    world.restore(world.save())
    world.reset_bodies()
    assert positions_of(world)["right_joint"] == pytest.approx(offset)
    world.remove("r")
    world.step(2)
    assert world.client.getNumConstraints() == 0


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Robots may come from ``tmp_path/robots``; ``tmp_path/secret.obj`` lies outside."""
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "part.obj").write_text("o part\n")
    (tmp_path / "secret.obj").write_text("o secret\n")
    monkeypatch.setattr("smartmesh_ros.io.urdf.LONGEST", 2000)
    monkeypatch.setattr("smartmesh_ros.io.urdf.MOST_LINKS", 3)
    return [folder]


@pytest.mark.parametrize(
    ("name", "inside"),
    [
        ("part.obj", True), ("package://part.obj", True), ("file://part.obj", True), ("file://p%61rt.obj", True),
        ("file://localhost{folder}/part.obj", True), ("../secret.obj", False), ("{outside}/secret.obj", False),
        ("file://{outside}/secret.obj", False), ("file://localhost{outside}/secret.obj", False),
        ("file://%2e./secret.obj", False), ("link.obj", False), ("/etc/passwd", False), ("x/../../secret.obj", False),
    ],
)  # fmt: skip
def test_meshes_are_taken_from_the_folders_alone(folders: list[Path], tmp_path: Path, name: str, inside: bool) -> None:
    folder = folders[0]
    (folder / "x").mkdir()
    (folder / "link.obj").symlink_to(tmp_path / "secret.obj")
    file = folder / "robot.urdf"
    file.write_text(robot(link("a", mesh(name.format(folder=folder, outside=tmp_path)))))
    if inside:
        assert checked_urdf(str(file), folders) == str(file.resolve())
        assert checked_urdf(robot(link("a", mesh(folder / "part.obj"))), folders)
        return
    with pytest.raises(InputError) as refused:
        checked_urdf(str(file), folders)
    assert refused.value.reason == "folder"


def test_a_mesh_that_a_text_may_not_have_is_refused_with_what_would_help(folders: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there, which takes effect at once; allowed now") as outside:
        checked_urdf(robot(link("a", mesh(tmp_path / "secret.obj"))), folders)
    assert "send the text" not in str(outside.value), "the text was sent"
    with pytest.raises(
        InputError, match=r"'part\.obj' that does not exist; a text has no folder, so name meshes by their"
    ):
        checked_urdf(robot(link("a", mesh("part.obj"))), folders)
    with pytest.raises(InputError, match=r"takes effect at once, or send the text instead of the path; allowed now"):
        checked_urdf(str(tmp_path / "robot.urdf"), folders)


def test_descriptions_outside_the_folders_are_refused_whether_there_or_not(folders: list[Path], tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(robot(A))
    (folders[0] / "link.urdf").symlink_to(tmp_path / "robot.urdf")
    for name in ("robot.urdf", "nothing.urdf", "robots/../robot.urdf", "robots/link.urdf", "robots2/robot.urdf"):
        with pytest.raises(InputError) as refused:
            checked_urdf(str(tmp_path / name), folders)
        assert refused.value.reason == "folder"  # and so nobody learns which files there are


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "entities"),
        (robot(link("a", more="x" * 3000)), "bytes"), (robot(A, B, C, link("d")), "4 links"),
        (robot(link("a", '<box size="1 nan 1"/>')), "finite"), (robot(link("a", mass=1e-300)), "mass"),
        (robot(link("a", '<sphere radius="1e300"/>')), "must be"), (robot(link("a", moment=1e300)), "ixx"),
        (robot(link("a", at="0 0 1e200")), "xyz"), (robot(A, B, AB.replace("0 0 0.3", "0 0 1e200")), "xyz"),
    ],
)  # fmt: skip
def test_descriptions_that_cannot_be_are_refused(folders: list[Path], text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked_urdf(text, folders)


@pytest.mark.parametrize(("mass", "moment"), [(1e-7, 1e-9), (4.19e-15, 1.68e-27)])
def test_a_light_frame_is_accepted(folders: list[Path], world: World, mass: float, moment: float) -> None:
    """NASA's Valkyrie has frames of 1e-7 kg, Unitree's B2 one of 4e-15 kg; the robot stands as it does without the
    frame."""
    text = "<!-- a comment is no entity, nor is literal text -->" + robot(
        link("a", '<box size="0.2 0.2 0.2"/>', 1.0, 0.01), link("b", "", mass, moment),
        joint("j", "fixed", "a", "b", xyz="0 0 0"), "<gazebo><![CDATA[a < b]]></gazebo>",
    )  # fmt: skip
    assert checked_urdf(text, folders) == text
    world.spawn_robot("robot", text, BodyState(), on_ground=True)
    world.step(240)
    assert world.state("robot").position[2] == pytest.approx(0.1, abs=1e-3)
