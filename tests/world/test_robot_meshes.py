"""Collision meshes of robots: read from files of every kind, or refused by the names of these."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import BodyState, InputError, World
from smartmesh_ros.world.robots.prepared import prepare_robot
from smartmesh_ros.world.robots.worker import MOST_OUTSIDE, fewer_vertices
from tests.core import mesh_parts
from tests.urdfs import joint, link, mesh, robot

BOX = np.array([0.4, 0.4, 0.1])  # edges of the mesh [m]


def facets() -> np.ndarray:
    """The twelve facets (12, 3, 3) of a box [m]."""
    corners, triangles = mesh_parts.box((-0.5 * BOX).tolist(), (0.5 * BOX).tolist())
    return np.asarray(corners[triangles])


def binary_stl() -> bytes:
    parts = [struct.pack("<12fH", 0, 0, 0, *f.ravel(), 0) for f in facets()]
    header = b"solid made by an exporter that begins like ASCII".ljust(80)
    return header + struct.pack("<I", len(parts)) + b"".join(parts)


def ascii_stl() -> bytes:
    lines = ["solid box"]
    for facet in facets():
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x:e} {y:e} {z:e}" for x, y, z in facet)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid box"]).encode()


def obj(scale: float = 1.0) -> bytes:
    return obj_of(scale * facets().reshape(-1, 3))


def obj_of(points: np.ndarray, first: int = 1) -> bytes:
    """An object of OBJ whose facets are three points each, the first of which has a number in its file."""
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    faces = [f"f {k} {k + 1} {k + 2}" for k in range(first, first + len(points) - 2, 3)]
    return "\n".join([*lines, *faces]).encode()


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
    "a node that moves": ("box.dae", lambda: collada(offset="0 0 -1")),
}


@pytest.mark.parametrize("kind", MESHES)
def test_a_robot_stands_on_its_collision_mesh(world: World, tmp_path: Path, kind: str) -> None:
    name, content = MESHES[kind]
    (tmp_path / name).write_bytes(content())
    file = tmp_path / "robot.urdf"
    file.write_text(robot(link("chassis", mesh(name)), link("mast"), joint("m", "fixed", "chassis", "mast")))
    world.spawn_robot("r", str(file), BodyState(), on_ground=True)
    assert list(world.bodies["r"].links.values()) == ["chassis", "mast"]
    height = 0.5 * BOX[2] + (1.0 if kind == "a node that moves" else 0.0)
    assert world.state("r").position[2] == pytest.approx(height, abs=2e-3)


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
def test_a_mesh_that_cannot_be_read_refuses_the_robot_by_its_name(world: World, tmp_path: Path, kind: str) -> None:
    name, content = UNREADABLE[kind]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"collision mesh .*{name}'"):
        world.spawn_robot("r", robot(link("a", mesh(tmp_path / name))))
    assert not world.bodies and world.client.getNumBodies() == 0


@pytest.mark.parametrize("suffix", [".stl", ".dae", ".obj"])
def test_a_pointer_of_git_lfs_in_the_place_of_a_mesh_is_named(world: World, tmp_path: Path, suffix: str) -> None:
    pointer = tmp_path / f"part{suffix}"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 4567\n")
    with pytest.raises(
        InputError, match=r"^collision mesh '[^']*' cannot be read: it is a pointer of Git LFS.*git lfs pull"
    ):
        world.spawn_robot("r", robot(link("a", mesh(pointer))))


def test_every_object_of_an_obj_file_and_every_collision_of_a_link_is_kept(world: World, tmp_path: Path) -> None:
    other = obj_of(facets().reshape(-1, 3) + (1.0, 0.0, 0.0), first=37)
    (tmp_path / "two.obj").write_bytes(b"\n".join([b"o one", obj(), b"o two", other]))
    ball = '<collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision></link>'
    urdf = robot(link("a", mesh(tmp_path / "two.obj")).replace("</link>", ball))
    world.spawn_robot("r", urdf, BodyState((0.0, 0.0, 0.2)))
    uid = world.bodies["r"].uid
    assert len(world.client.getCollisionShapeData(uid, -1)) == 2
    for x, top in ((0.0, 1.3), (1.0, 0.25), (0.5, None)):
        [hit] = world.client.rayTest((x, 0.0, 5.0), (x, 0.0, -5.0))
        assert (hit[0] == uid) == (top is not None)
        if top is not None:
            assert hit[3][2] == pytest.approx(top, abs=5e-3)


def test_the_content_of_a_mesh_counts_when_a_robot_is_prepared_not_its_name(world: World, tmp_path: Path) -> None:
    """Nor what becomes of its file."""
    urdf = robot(link("a", mesh(tmp_path / "box.obj", 'scale="1 1 0.5"')))
    for factor in (1.0, 2.0):
        (tmp_path / "box.obj").write_bytes(obj(factor))
        prepared = prepare_robot(urdf)
        (tmp_path / "box.obj").unlink()
        world.spawn_robot(f"r{factor}", prepared, BodyState((-1.0 + factor, 0.0, 0.0)), on_ground=True)
        assert world.state(f"r{factor}").position[2] == pytest.approx(0.25 * factor * BOX[2], abs=2e-3)
    with pytest.raises(InputError, match="does not exist"):
        prepare_robot(urdf)


def test_hulls_of_thousands_of_vertices_keep_their_extent(world: World, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20_000, 3))
    points *= (0.3, 0.2, 0.1) / np.linalg.norm(points, axis=1, keepdims=True)
    (tmp_path / "ball.obj").write_bytes(obj_of(points))
    links = [link(f"l{k}", mesh(tmp_path / "ball.obj")) for k in range(4)]
    joints = [joint(f"j{k}", "fixed", "l0", f"l{k}", xyz=f"{k} 0 0") for k in range(1, 4)]
    world.spawn_robot("r", robot(*links, *joints), BodyState((-1.5, 0.0, 1.0)))
    vertices = np.array(world.client.getMeshData(world.bodies["r"].uid, -1)[1])
    assert len(vertices) < 3000 and len(fewer_vertices(points, 64)) < 2500
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    missing = (points @ directions.T).max(axis=0) - (vertices @ directions.T).max(axis=0)
    assert missing.max() < 1e-3


def test_few_vertices_of_a_disc_hold_the_others() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    disc = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    kept = fewer_vertices(disc, 8)
    assert len(fewer_vertices(disc[:40], 64)) == 40
    around = np.sort(np.arctan2(kept[:, 1], kept[:, 0]))
    assert 1.0 - np.cos(0.5 * np.diff(around).max()) <= MOST_OUTSIDE
