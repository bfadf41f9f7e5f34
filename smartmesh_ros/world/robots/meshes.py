"""Points of collision meshes. PyBullet reads no ASCII STL and not every COLLADA, and says nothing about either.

STL and COLLADA files are one convex part, OBJ files a part for each object, as PyBullet takes them. COLLADA is taken as
ROS does: in metres by the file's unit, and as if z were up.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.obj_parts import obj_parts
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.robots.collada import collada_points

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes of a binary STL before its facets
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def mesh_parts(path: Path, scale: tuple[float, float, float]) -> list[FloatArray]:
    """Return the points (n, 3) [m] of each convex part of a mesh. Raises `InputError` that names the file."""
    readers = {".stl": _stl, ".obj": _obj, ".dae": _collada}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise _refused(path, f"only {', '.join(readers)} are read; convert it")
    try:
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
    return InputError("urdf", f"collision mesh {str(path)!r} cannot be read: {why}")


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


def _obj(path: Path) -> list[FloatArray]:
    return obj_parts(str(path))


def _collada(path: Path) -> list[FloatArray]:
    return [collada_points(ElementTree.parse(path).getroot())]
