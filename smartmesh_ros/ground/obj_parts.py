"""The objects of an OBJ file. PyBullet makes a convex hull of each."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray


def obj_parts(path: str) -> list[FloatArray]:
    """Return the points (n, 3) that the faces of each object or group of an OBJ file use; an empty list if the file
    cannot be read."""
    try:
        lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
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
