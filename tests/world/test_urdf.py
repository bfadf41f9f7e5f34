"""Robot descriptions from peers: kept to their folders and to numbers that can be simulated."""

from pathlib import Path

import pytest

from smartmesh_ros import BodyState, InputError, World
from smartmesh_ros.io.urdf import UrdfRules, checked_urdf
from tests.urdfs import joint, link, robot

MESH = '<robot name="r"><link name="a"><collision><geometry><mesh filename="{}"/></geometry></collision></link></robot>'
SHAPE = '<robot name="r"><link name="a">{}</link></robot>'


@pytest.fixture
def rules(tmp_path: Path) -> UrdfRules:
    """Robots may come from ``tmp_path/robots``; ``tmp_path/secret.obj`` lies outside."""
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "part.obj").write_text("o part\n")
    (tmp_path / "secret.obj").write_text("o secret\n")
    return UrdfRules(folders=(folder,), longest=2000, most_links=3)


@pytest.mark.parametrize(
    ("name", "inside"),
    [
        ("part.obj", True), ("package://part.obj", True), ("file://part.obj", True), ("file://p%61rt.obj", True),
        ("file://localhost{folder}/part.obj", True), ("../secret.obj", False), ("{outside}/secret.obj", False),
        ("file://{outside}/secret.obj", False), ("file://localhost{outside}/secret.obj", False),
        ("file://%2e./secret.obj", False), ("link.obj", False), ("/etc/passwd", False), ("x/../../secret.obj", False),
    ],
)  # fmt: skip
def test_meshes_are_taken_from_the_folders_alone(rules: UrdfRules, tmp_path: Path, name: str, inside: bool) -> None:
    folder = rules.folders[0]
    (folder / "x").mkdir()
    (folder / "link.obj").symlink_to(tmp_path / "secret.obj")
    file = folder / "robot.urdf"
    file.write_text(MESH.format(name.format(folder=folder, outside=tmp_path)))
    if inside:
        assert checked_urdf(str(file), rules) == str(file.resolve())
        assert checked_urdf(MESH.format(folder / "part.obj"), rules)
        return
    with pytest.raises(InputError) as refused:
        checked_urdf(str(file), rules)
    assert refused.value.reason == "folder"


def test_descriptions_outside_the_folders_are_refused_whether_there_or_not(rules: UrdfRules, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(SHAPE.format(""))
    (rules.folders[0] / "link.urdf").symlink_to(tmp_path / "robot.urdf")
    for name in ("robot.urdf", "nothing.urdf", "robots/../robot.urdf", "robots/link.urdf", "robots2/robot.urdf"):
        with pytest.raises(InputError) as refused:
            checked_urdf(str(tmp_path / name), rules)
        assert refused.value.reason == "folder"  # and so nobody learns which files there are


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot>", "does not load"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "entities"),
        (SHAPE.format("x" * 3000), "bytes"),
        ('<robot name="r">' + '<link name="a"/>' * 4 + "</robot>", "4 links"),
        (SHAPE.format('<collision><geometry><box size="1 nan 1"/></geometry></collision>'), "finite"),
        (SHAPE.format('<collision><geometry><sphere radius="1e300"/></geometry></collision>'), "must be"),
        (SHAPE.format('<inertial><mass value="1e-300"/></inertial>'), "mass"),
        (SHAPE.format('<inertial><inertia ixx="1e300"/></inertial>'), "ixx"),
        (SHAPE.format('<collision><origin xyz="0 0 1e200"/></collision>'), "xyz"),
        (MESH.format("nothing.obj"), "does not exist"),
    ],
)
def test_descriptions_that_cannot_be_are_refused(rules: UrdfRules, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked_urdf(text, rules)


def test_a_light_frame_is_accepted(rules: UrdfRules, world: World) -> None:
    """NASA's Valkyrie has frames of 1e-7 kg; the robot stands as it does without the frame."""
    text = "<!-- a comment is no entity -->" + robot(
        link("a", '<box size="0.2 0.2 0.2"/>', 1.0, 0.01), link("b", "", 1e-7, 1e-9),
        joint("j", "fixed", "a", "b", xyz="0 0 0"),
    )  # fmt: skip
    assert checked_urdf(text, rules) == text
    world.spawn_robot("robot", text, BodyState(), on_ground=True)
    world.step(240)
    assert world.state("robot").position[2] == pytest.approx(0.1, abs=1e-3)
