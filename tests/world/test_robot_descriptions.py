"""Robot descriptions: refused as a whole with a reason, or simulated as URDF means them."""

import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, HeightMap, InputError, Sphere, World
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.robots.prepared import prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP
from tests.urdfs import joint, link, robot

Facets = np.ndarray
BOX = np.array([0.4, 0.4, 0.1])  # edges of the mesh [m]


def mesh(file: str, more: str = "") -> str:
    return f'<mesh filename="{file}" {more}/>'


A, B, C = link("a"), link("b"), link("c")
AB, BC, AC = (joint(f"{p}{c}", "fixed", p, c) for p, c in ("ab", "bc", "ac"))
BROKEN = {
    "two roots": (robot(A, B), "'a', 'b'"),
    "one link apart": (robot(A, B, C, AB), "'a', 'c'"),
    "a joint's name twice": (robot(A, B, C, AB, AC.replace("ac", "ab")), "2 joints are named 'ab'"),
    "a link's name twice": (robot(A, A, B, AB), "2 links are named 'a'"),
    "a link with two parents": (robot(A, B, C, AB, BC, AC), "'c' is the child of joints 'bc' and 'ac'"),
    "a closed loop": (robot(A, B, AB, joint("ba", "fixed", "b", "a")), "no parent|ancestor"),
    "a loop beside the tree": (
        robot(A, B, C, joint("bc", "fixed", "b", "c"), joint("cb", "fixed", "c", "b")), "ancestor",
    ),
    "its own parent": (robot(A, joint("aa", "fixed", "a", "a")), "ancestor"),
    "a joint without type": (robot(A, B, joint("ab", "", "a", "b")), "'ab' has no type"),
    "a joint of unknown type": (robot(A, B, joint("ab", "hinge", "a", "b")), "'ab' has the type 'hinge'"),
    "a floating joint": (robot(A, B, joint("ab", "floating", "a", "b")), "'ab' is floating"),
    "a parent that is not there": (robot(A, B, joint("xb", "fixed", "x", "b")), "link 'x', which does not exist"),
    "a joint without child": (robot(A, B, AB.replace('<child link="b"/>', "")), "0 elements <child>"),
    "a link without name": (robot(A.replace(' name="a"', "")), "a link of the URDF has no name"),
    "no link": (robot(), "no link"),
    "a joint without name": (robot(A, B, AB.replace(' name="ab"', "")), "a joint of the URDF has no name"),
    "a name longer than PyBullet's field": (robot(link("a" * 3000)), "3000 characters"),
    "an axis of zero": (
        robot(A, B, joint("ab", "revolute", "a", "b").replace("0 1 0", "0 0 0")), "the axis of joint 'ab' is zero",
    ),
    "a box of two edges": (robot(link("a", '<box size="1 1"/>')), "3 numbers"),
    "a sphere without radius": (robot(link("a", "<sphere/>")), "must be a number"),
    "a shape of no kind": (robot(link("a", '<cone radius="1"/>')), "<cone>"),
    "a collision without geometry": (robot(link("a", "")[:-7] + "<collision/></link>"), "nothing"),
    "a mass that is no number": (robot(A.replace('value="1.0"', 'value="heavy"')), "mass"),
    "no inertia": (robot('<link name="a"><inertial><mass value="1"/></inertial></link>'), "<inertia"),
    "no shape": (robot(link("a", "")), "no collision shape"),
    "no XML": ("<robot", "no XML"),
    "SDF": ("<sdf/>", "<sdf>"),
    "a Xacro expression": (robot(link("a", '<sphere radius="${radius}"/>')), r"Xacro \('\$\{radius\}'\)"),
    "a Xacro expression in a name": (robot(link("${prefix}a")), "Xacro"),
    "Xacro elements": (
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:base/></robot>', "Xacro .*xacro:base",
    ),
    "Xacro elements without their name space": (robot(A, "<xacro:base/>"), "Xacro"),
    "a mimic of no joint": (
        robot(A, B, joint("ab", "revolute", "a", "b", '<mimic joint="x"/>')), "'ab' mimics 'x'",
    ),
    "a mimic of itself": (
        robot(A, B, C, joint("ab", "revolute", "a", "b", '<mimic joint="bc"/>'),
              joint("bc", "revolute", "b", "c", '<mimic joint="ab"/>')), "mimics itself",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_a_refused_robot_leaves_the_world_as_it_was(world: World, kind: str) -> None:
    urdf, words = BROKEN[kind]
    good = robot(A)
    world.spawn_robot("good", good, BodyState((0.0, 0.0, 0.2)))
    bodies, state = world.client.getNumBodies(), world.state("good")
    for add in (
        lambda: world.spawn_robot("bad", urdf, BodyState((1.0, 0.0, 1.0))),
        lambda: world.spawn_robot("bad", urdf, BodyState((1.0, 0.0, 1.0)), on_ground=True),
        lambda: world.replace_robot("good", urdf),
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


def test_a_snapshot_with_a_refused_robot_and_a_wrong_radius_change_nothing(world: World) -> None:
    world.spawn_robot("good", robot(A), BodyState((0.0, 0.0, 0.2)))
    world.track("ghost", 0.2, BodyState((1.0, 1.0, 1.0)))
    saved = world.snapshot()
    bad = replace(saved.bodies[0], urdf=BROKEN["a Xacro expression"][0])
    with pytest.raises(InputError, match="Xacro"):
        world.restore(replace(saved, bodies=(*saved.bodies[1:], bad)))
    with pytest.raises(InputError, match="radius"):
        world.track("ghost", -1.0, BodyState((1.0, 1.0, 1.0)))
    assert world.snapshot().hash == saved.hash


def test_a_loader_that_crashes_or_hangs_refuses_the_robot(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    for code in ("import os; os.kill(os.getpid(), 11)", "import time; time.sleep(1000)"):
        monkeypatch.setattr("smartmesh_ros.world.robots.workshop._START", code)
        monkeypatch.setattr("smartmesh_ros.world.robots.workshop.PATIENCE", 0.5)
        WORKSHOP.close()
        with pytest.raises(InputError, match="crashes or hangs"):
            world.spawn_robot("r", robot(link("a", '<sphere radius="0.123"/>')))
    monkeypatch.undo()
    world.spawn_robot("r", robot(link("a", '<sphere radius="0.123"/>')))


def test_the_child_ends_with_its_parent_and_a_known_robot_needs_none(world: World) -> None:
    script = (
        "from smartmesh_ros.world.robots.prepared import prepare_robot; from smartmesh_ros.world.robots.workshop "
        f"import WORKSHOP; prepare_robot({robot(A)!r}); print(WORKSHOP._child.pid, flush=True); input()"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert Path(f"/proc/{child}").exists()
        parent.kill()
        parent.wait()
        while Path(f"/proc/{child}").exists():
            pass
    first = prepare_robot(robot(B))
    WORKSHOP.close()
    assert prepare_robot(robot(B) + "\n").files == first.files


def facets() -> Facets:
    """The twelve facets (12, 3, 3) of a box [m]."""
    corners = 0.5 * BOX * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return np.array([corners[[q[0], q[i], q[i + 1]]] for q in quads for i in (1, 2)])


def binary_stl(header: bytes = b"solid made by an exporter that begins like ASCII") -> bytes:
    parts = [struct.pack("<12fH", 0, 0, 0, *f.ravel(), 0) for f in facets()]
    return header.ljust(80) + struct.pack("<I", len(parts)) + b"".join(parts)


def ascii_stl() -> bytes:
    lines = ["solid box"]
    for facet in facets():
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x:e} {y:e} {z:e}" for x, y, z in facet)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid box"]).encode()


def obj() -> bytes:
    corners = facets().reshape(-1, 3)
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    return "\n".join([*lines, *(f"f {k + 1} {k + 2} {k + 3}" for k in range(0, len(corners), 3))]).encode()


def collada(primitive: str = "triangles", unit: float = 1.0, scene: bool = True, offset: str = "0 0 0") -> bytes:
    """A box in COLLADA: its facets as a kind of primitive, in a unit [m], at an offset of its node."""
    points = facets().reshape(-1, 3) / unit
    numbers = [f"{k} 0" for k in range(len(points))]
    groups = [" ".join(numbers[k : k + 3]) for k in range(0, len(numbers), 3)]
    counts = f"<vcount>{'3 ' * len(groups)}</vcount>" if primitive == "polylist" else ""
    separate = primitive in ("polygons", "tristrips", "trifans")
    indices = "".join(f"<p>{group}</p>" for group in groups) if separate else f"<p>{' '.join(groups)}</p>"
    node = f'<node id="n"><translate>{offset}</translate><instance_geometry url="#g"/></node>'
    scenes = (
        f'<library_visual_scenes><visual_scene id="s">{node}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene>'
    )
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter="{unit}"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="{points.size}">{" ".join(map(str, points.ravel().tolist()))}</float_array>
<technique_common><accessor source="#pa" count="{len(points)}" stride="3"/></technique_common></source>
<source id="n0"><float_array id="na" count="3">0 0 1</float_array><technique_common>
<accessor source="#na" count="1" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<{primitive} count="{len(groups)}"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#n0" offset="1"/>{counts}{indices}</{primitive}></mesh></geometry></library_geometries>
{scenes if scene else ""}</COLLADA>""".encode()


MESHES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "binary STL": ("box.stl", binary_stl),
    "ASCII STL": ("box.stl", ascii_stl),
    "STL in capitals": ("box.STL", ascii_stl),
    "OBJ": ("box.obj", obj),
    "triangles": ("box.dae", collada),
    "polylist": ("box.dae", lambda: collada("polylist")),
    "polygons": ("box.dae", lambda: collada("polygons")),
    "tristrips": ("box.dae", lambda: collada("tristrips")),
    "millimetres": ("box.dae", lambda: collada(unit=0.001)),
    "without a scene": ("box.dae", lambda: collada(scene=False)),
}


@pytest.mark.parametrize("kind", MESHES)
def test_a_robot_stands_on_its_collision_mesh(world: World, tmp_path: Path, kind: str) -> None:
    name, content = MESHES[kind]
    (tmp_path / name).write_bytes(content())
    file = tmp_path / "robot.urdf"
    file.write_text(robot(link("chassis", mesh(name)), link("mast"), joint("m", "fixed", "chassis", "mast")))
    world.spawn_robot("r", str(file), BodyState((0.0, 0.0, 0.2)))
    assert list(world.bodies["r"].links.values()) == ["chassis", "mast"]
    world.step(480)
    assert world.state("r").position[2] == pytest.approx(0.5 * BOX[2], abs=2e-3)


def test_a_node_of_a_scene_moves_and_a_scale_scales_its_mesh(world: World, tmp_path: Path) -> None:
    (tmp_path / "box.dae").write_bytes(collada(offset="0 0 1"))
    shape = mesh(str(tmp_path / "box.dae"), 'scale="1 1 0.5"')
    world.spawn_robot("r", robot(link("a", shape)), BodyState(), on_ground=True)
    assert world.base_state("r").position[2] == pytest.approx(-0.5 * (1.0 - 0.5 * BOX[2]), abs=2e-3)


UNREADABLE: dict[str, tuple[str, bytes]] = {
    "glTF": ("part.glb", b"glTF"),
    "no suffix": ("part", b"solid"),
    "an STL that ends too early": ("part.stl", binary_stl()[:-10]),
    "an empty STL": ("part.stl", b""),
    "a binary STL without facets": ("part.stl", b" " * 80 + bytes(4)),
    "an ASCII STL with a word for a number": ("part.stl", ascii_stl().replace(b"e-01 ", b"e-x ", 1)),
    "an OBJ without facets": ("part.obj", b"v 0 0 0\n"),
    "an OBJ with a corner that is not there": ("part.obj", b"v 0 0 0\nf 1 2 3\n"),
    "an OBJ with NaN": ("part.obj", obj().replace(b"v 0.2", b"v nan")),
    "COLLADA without geometry": ("part.dae", b"<COLLADA/>"),
    "COLLADA of lines": ("part.dae", collada("lines")),
    "COLLADA with a corner that is not there": ("part.dae", collada().replace(b"<p>0 0", b"<p>9999 0")),
    "COLLADA that ends too early": ("part.dae", collada()[:-300]),
    "COLLADA with a broken reference": ("part.dae", collada().replace(b'url="#g"', b'url="#x"')),
}


@pytest.mark.parametrize("kind", UNREADABLE)
def test_a_collision_mesh_that_cannot_be_read_refuses_the_robot_by_its_name(
    world: World, tmp_path: Path, kind: str
) -> None:
    name, content = UNREADABLE[kind]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"collision mesh .*{name}'"):
        world.spawn_robot("r", robot(link("a", mesh(str(tmp_path / name))), B, AB))
    assert not world.bodies and world.client.getNumBodies() == 0


@pytest.mark.parametrize(
    "visual", [mesh("none.glb"), mesh("/no/such.stl"), '<box size="0 0 0"/>', "", '<cone radius="nan"/>'],
)  # fmt: skip
def test_visuals_never_matter(world: World, visual: str) -> None:
    seen = f'<visual><origin xyz="nan 0 0"/><geometry>{visual}</geometry></visual><collision>'
    world.spawn_robot("r", robot(A.replace("<collision>", seen)), BodyState((0.0, 0.0, 0.1)))
    world.step(10)
    assert world.state("r").position[2] == pytest.approx(0.1, abs=1e-3)


def test_every_object_of_an_obj_file_and_every_collision_of_a_link_is_kept(world: World, tmp_path: Path) -> None:
    one = obj().decode()
    lines = ["o one", one, "o two"]
    lines += [f"v {x + 1.0} {y} {z}" for x, y, z in facets().reshape(-1, 3)]
    lines += [f"f {k + 1} {k + 2} {k + 3}" for k in range(36, 72, 3)]
    (tmp_path / "two.obj").write_text("\n".join(lines))
    ball = '<collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision></link>'
    urdf = robot(link("a", mesh(str(tmp_path / "two.obj"))).replace("</link>", ball))
    world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 0.2)))
    uid = world.bodies["r"].uid
    assert len(world.client.getCollisionShapeData(uid, -1)) == 2
    for x, top in ((0.0, 1.3), (1.0, 0.25), (0.5, None)):
        [hit] = world.client.rayTest((x, 0.0, 5.0), (x, 0.0, -5.0))
        assert (hit[0] == uid) == (top is not None)
        if top is not None:
            assert hit[3][2] == pytest.approx(top, abs=5e-3)


def test_pybullet_never_opens_a_file_of_the_robot_in_this_process(tmp_path: Path) -> None:
    (tmp_path / "box.stl").write_bytes(binary_stl())
    prepared = prepare_robot(robot(link("a", mesh(str(tmp_path / "box.stl")))))
    (tmp_path / "box.stl").unlink()
    with World(HeightMap(np.zeros((5, 5)))) as world:
        world.spawn_robot("r", prepared, BodyState((1.0, 1.0, 1.0)))
        assert [name.endswith(".obj") for name in prepared.files] == [True]
    with pytest.raises(InputError, match="does not exist"):
        prepare_robot(robot(link("a", mesh(str(tmp_path / "box.stl")))))


def test_the_content_of_a_mesh_counts_not_its_name(world: World, tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_bytes(obj())
    urdf = robot(link("a", mesh(str(tmp_path / "box.obj"))))
    for factor in (1.0, 2.0):
        (tmp_path / "box.obj").write_text(
            "\n".join(
                f"v {' '.join(str(factor * float(w)) for w in line.split()[1:])}" if line.startswith("v") else line
                for line in obj().decode().splitlines()
            )
        )
        world.spawn_robot(f"r{factor}", urdf, BodyState((-1.0 + factor, 0.0, 0.0)), on_ground=True)
        assert world.state(f"r{factor}").position[2] == pytest.approx(0.5 * factor * BOX[2], abs=2e-3)


def test_hulls_of_thousands_of_vertices_keep_their_extent(world: World, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20_000, 3))
    points *= 0.3 / np.linalg.norm(points, axis=1, keepdims=True)
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    faces = [f"f {k} {k + 1} {k + 2}" for k in range(1, len(points) - 1, 3)]
    (tmp_path / "ball.obj").write_text("\n".join([*lines, *faces]))
    robots = [link(f"l{k}", mesh(str(tmp_path / "ball.obj"))) for k in range(4)]
    joints = [joint(f"j{k}", "fixed", "l0", f"l{k}", xyz=f"{k} 0 0") for k in range(1, 4)]
    prepared = prepare_robot(robot(*robots, *joints))
    world.spawn_robot("r", prepared, BodyState((-1.5, 0.0, 1.0)))
    vertices = np.array(world.client.getMeshData(world.bodies["r"].uid, -1)[1])
    assert len(vertices) < 3000
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    missing = (points @ directions.T).max(axis=0) - (vertices @ directions.T).max(axis=0)
    assert missing.max() < 1e-3


@pytest.mark.parametrize("inertial", [0.0, None], ids=["mass 0", "no inertial"])
def test_a_root_without_mass_is_one_body_with_what_is_fixed_to_it(
    world: World, inertial: float | None, caplog: pytest.LogCaptureFixture
) -> None:
    """PAL's base_footprint: the robot falls, and its frames and names are those of the URDF."""
    box = '<box size="0.5 0.5 0.2"/>'
    urdf = robot(
        link("base_footprint", "", inertial), link("frame", "", 0.0), link("base_link", box, 30.0),
        joint("f", "fixed", "base_footprint", "frame", xyz="0 0 0.04"),
        joint("g", "fixed", "frame", "base_link", xyz="0 0 0.06"),
    )  # fmt: skip
    world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 0.3)))
    assert world.bodies["r"].mass == pytest.approx(30.0)
    assert list(world.bodies["r"].links.values()) == ["base_link"]
    [line] = [line for line in caplog.messages if "base_footprint" in line]
    assert "merged with link 'base_link'" in line
    assert world.base_state("r").position[2] == pytest.approx(0.3, abs=1e-6)
    speed = 9.81 * 24 / 240.0
    world.step(24)
    assert world.state("r").linear[2] == pytest.approx(-speed, rel=1e-6), "free fall"
    world.step(456)
    assert world.base_state("r").position[2] == pytest.approx(0.0, abs=2e-3)
    assert sum(wrench.force[2] for wrench in world.wrenches()) == pytest.approx(30.0 * 9.81, rel=0.02)


@pytest.mark.parametrize("name", ["world", "plinth"])
def test_a_root_that_stands_for_the_world_stays(world: World, name: str, caplog: pytest.LogCaptureFixture) -> None:
    urdf = robot(
        link(name, "", None if name == "world" else 0.0), link("arm"),
        joint("j", "fixed" if name == "world" else "continuous", name, "arm"),
    )  # fmt: skip
    world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 1.0)))
    world.step(120)
    assert world.base_state("r").position[2] == pytest.approx(1.0)
    assert any(name in line and "not move" in line for line in caplog.messages)


LIMIT = '<limit lower="-1" upper="1" effort="20" velocity="5"/>'


@pytest.mark.parametrize(
    ("kinds", "parent", "multiplier", "offset"),
    [
        (("prismatic", "prismatic"), "base", -1.0, 0.0), (("revolute", "revolute"), "base", 2.0, 0.1),
        (("revolute", "continuous"), "left", -1.0, 0.0), (("revolute", "prismatic"), "base", 0.5, -0.05),
        (("prismatic", "revolute"), "base", 0.0, 0.2),
    ],
)  # fmt: skip
def test_a_joint_that_mimics_another_follows_it(
    kinds: tuple[str, str], parent: str, multiplier: float, offset: float, caplog: pytest.LogCaptureFixture
) -> None:
    more = f'{LIMIT}<mimic joint="left_joint" multiplier="{multiplier}" offset="{offset}"/>'
    urdf = robot(
        link("base", '<box size="0.4 0.4 0.2"/>', 5.0), link("left", "", 0.1), link("right", "", 0.1),
        joint("left_joint", kinds[0], "base", "left", LIMIT), joint("right_joint", kinds[1], parent, "right", more),
    )  # fmt: skip
    with World(HeightMap(np.zeros((41, 41)), resolution=0.1, origin=(-2.0, -2.0))) as world:
        world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 0.1)))
        assert any("'right_joint' follows 'left_joint'" in line for line in caplog.messages)
        positions = {reading.name: reading.position for reading in world.joints("r")}
        assert positions == {"left_joint": 0.0, "right_joint": pytest.approx(offset)}
        for target in (0.03, -0.4):
            world.command("r", "left_joint", JointCommand(position=target))
            for count in (60, 300):
                world.step(count)
                positions = {reading.name: reading.position for reading in world.joints("r")}
                follows = multiplier * positions["left_joint"] + offset
                assert positions["right_joint"] == pytest.approx(follows, abs=5e-3)
            assert positions["left_joint"] == pytest.approx(target, abs=5e-3)
        saved = world.save()
        world.restore(saved)
        world.reset_bodies()
        assert {r.name: r.position for r in world.joints("r")}["right_joint"] == pytest.approx(offset)
        world.remove("r")
        world.step(2)
        assert world.client.getNumConstraints() == 0


def test_a_planar_joint_moves_in_its_plane() -> None:
    """PyBullet's loader takes it as URDF means it, so it is accepted."""
    prepared = prepare_robot(robot(link("a", mass=0.0), B, joint("p", "planar", "a", "b").replace("0 1 0", "0 0 1")))
    with World(HeightMap(np.zeros((5, 5)))) as world:
        world.spawn_robot("r", prepared, BodyState((1.0, 1.0, 1.0)))
        uid = world.bodies["r"].uid
        for _ in range(100):
            world.client.applyExternalForce(uid, 0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), pb.WORLD_FRAME)
            world.client.stepSimulation()
        x, _, z = world.client.getLinkState(uid, 0)[0]
        assert x > 1.01
        assert z == pytest.approx(1.3)
