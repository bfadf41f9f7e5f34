"""Points of collision meshes. PyBullet reads no ASCII STL and not every COLLADA, and says nothing about either.

STL and COLLADA files are one convex part, OBJ files a part for each object, as PyBullet takes them. COLLADA is taken as
ROS does: in metres by the file's unit, and as if z were up.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes of a binary STL before its facets
_POINTER = b"version https://git-lfs.github.com/spec/"
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def mesh_parts(path: Path, scale: tuple[float, float, float]) -> list[FloatArray]:
    """Return the points (n, 3) [m] of each convex part of a mesh. Raises `InputError` that names the file."""
    readers: dict[str, Callable[[Path], list[FloatArray]]] = {
        ".stl": _stl,
        ".obj": obj_parts,
        ".dae": lambda path: [collada_points(ElementTree.parse(path).getroot())],
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise _refused(path, f"only {', '.join(readers)} are read; convert it")
    try:
        with path.open("rb") as file:
            if file.read(len(_POINTER)) == _POINTER:
                raise ValueError("it is a pointer of Git LFS; fetch the file itself: git lfs pull")
        parts = reader(path)
    except (OSError, ValueError, LookupError, TypeError, ElementTree.ParseError) as error:
        raise _refused(path, str(error) or type(error).__name__) from None
    parts = [np.unique(part * scale, axis=0) for part in parts if len(part)]
    if not parts:
        raise _refused(path, "there is no facet in it")
    if not all(np.isfinite(part).all() for part in parts):
        raise _refused(path, "a coordinate is not finite")
    return parts


def _refused(path: Path, why: str) -> InputError:
    return InputError("asset", f"collision mesh {str(path)!r} cannot be read: {why}")


def _stl(path: Path) -> list[FloatArray]:
    data = path.read_bytes()
    count = int.from_bytes(data[80:_HEADER], "little")
    ends = _HEADER + _STL_FACET.itemsize * count
    if len(data) < _HEADER or ends > len(data) or (ends < len(data) and b"vertex" in data):
        words = np.array(_VERTEX.findall(data), dtype=np.bytes_).reshape(-1, 3)
        if len(words) % 3 or not len(words):
            raise ValueError("it is neither a binary nor an ASCII STL, or it is not complete")
        return [words.astype(np.float64)]
    return [np.frombuffer(data, _STL_FACET, count, _HEADER)["corners"].reshape(-1, 3).astype(np.float64)]


def obj_parts(path: Path) -> list[FloatArray]:
    """Return the points (n, 3) that the faces of each object or group of an OBJ file use."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    points: list[list[float]] = []
    objects: list[set[int]] = [set()]
    for line in lines:
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            points.append([float(word) for word in words[1:4]])
        elif words[0] in ("o", "g"):
            objects.append(set())
        elif words[0] == "f":
            numbers = [int(word.partition("/")[0]) for word in words[1:]]
            objects[-1].update(number - 1 if number > 0 else len(points) + number for number in numbers)
    array = np.array(points, np.float64).reshape(-1, 3)
    return [array[sorted(used)] for used in objects if used]


_PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
# Deepest chain of nodes, so that a file whose nodes contain themselves ends.
_DEEPEST = 50


def collada_points(root: Element) -> FloatArray:
    """Return the points (n, 3) [m] of all facets of a COLLADA document: those of its scene, or of all geometries if it
    has none. Raises `ValueError` or `LookupError` if the document is not complete."""
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    by_id = {name: element for element in root.iter() if (name := element.get("id"))}
    unit = root.find("asset/unit")
    metre = 1.0 if unit is None else float(unit.get("meter", "1"))
    scenes = [by_id[_reference(scene, "url")] for scene in root.findall("scene/instance_visual_scene")]
    scenes = scenes or root.findall("library_visual_scenes/visual_scene")[:1]
    found = [points for scene in scenes for points in _of_node(scene, np.eye(4), by_id, 0)]
    if not scenes:
        found = [_of_geometry(geometry, by_id) for geometry in root.findall("library_geometries/geometry")]
    return metre * np.concatenate([np.empty((0, 3)), *found])


def _of_node(node: Element, above: FloatArray, by_id: dict[str, Element], depth: int) -> Iterator[FloatArray]:
    """Yield the points of a node's geometries and of the nodes below it."""
    if depth > _DEEPEST:
        raise ValueError(f"its nodes are more than {_DEEPEST} deep")
    pose = above
    for element in node:
        pose = pose @ _transform(element)
    for element in node:
        if element.tag == "instance_geometry":
            points = _of_geometry(by_id[_reference(element, "url")], by_id)
            yield points @ pose[:3, :3].T + pose[:3, 3]
        elif element.tag == "node":
            yield from _of_node(element, pose, by_id, depth + 1)
        elif element.tag == "instance_node":
            yield from _of_node(by_id[_reference(element, "url")], pose, by_id, depth + 1)


def _transform(element: Element) -> FloatArray:
    """Return the transform (4, 4) of an element of a node; identity if it is none."""
    made = np.eye(4)
    if element.tag == "matrix":
        return _floats(element).reshape(4, 4)
    if element.tag == "translate":
        made[:3, 3] = _floats(element)
    elif element.tag == "scale":
        made[:3, :3] = np.diag(_floats(element))
    elif element.tag == "rotate":
        *axis, degrees = _floats(element).tolist()
        x, y, z = np.array(axis) / np.linalg.norm(axis)
        across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = np.radians(degrees)
        made[:3, :3] += np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    return made


def _of_geometry(geometry: Element, by_id: dict[str, Element]) -> FloatArray:
    """Return the points (n, 3) that the facets of a geometry use."""
    parts = [np.empty((0, 3))]
    for mesh in geometry.findall("mesh"):
        for primitive in (element for element in mesh if element.tag in _PRIMITIVES):
            inputs = primitive.findall("input")
            [corner] = [entry for entry in inputs if entry.get("semantic") == "VERTEX"]
            stride = 1 + max(int(entry.get("offset", "0")) for entry in inputs)
            first = int(corner.get("offset", "0"))
            points = _positions(by_id[_reference(corner, "source")], by_id)
            for indices in primitive.iter("p"):
                chosen = np.array((indices.text or "").split(), np.int64)[first::stride]
                if len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(points):
                    raise ValueError("a facet has a corner that does not exist")
                parts.append(points[chosen])
    return np.concatenate(parts)


def _positions(vertices: Element, by_id: dict[str, Element]) -> FloatArray:
    """Return the positions (n, 3) of a <vertices> element."""
    [entry] = [entry for entry in vertices.findall("input") if entry.get("semantic") == "POSITION"]
    source = by_id[_reference(entry, "source")]
    array, accessor = source.find("float_array"), source.find("technique_common/accessor")
    if array is None:
        raise ValueError("it has a source without numbers")
    stride = 3 if accessor is None else int(accessor.get("stride", "1"))
    offset = 0 if accessor is None else int(accessor.get("offset", "0"))
    values = _floats(array)[offset:]
    return values[: len(values) // stride * stride].reshape(-1, stride)[:, :3]


def _floats(element: Element) -> FloatArray:
    return np.array((element.text or "").split(), np.float64)


def _reference(element: Element, key: str) -> str:
    return element.get(key, "").lstrip("#")
