"""The ground that a node draws on ``~/scene``, for a client that has no map of it."""

from __future__ import annotations

import numpy as np
from visualization_msgs.msg import Marker

from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.terrain.grid import FloatArray


def drawn_ground(scene: bytes) -> FloatArray | None:
    """Return the corners (n, 3) [m] of the triangles of ground in a MarkerArray; None = it has none, because the ground
    has not changed. Raises `InputError` if the bytes are malformed.

    Reads the bytes, because rclpy takes 50 ms to make an object of each corner."""
    reader, found = CdrReader(scene), None
    for _ in range(reader.count(1)):
        kind, action, points = _read_marker(reader)
        if (kind, action) == (Marker.TRIANGLE_LIST, Marker.ADD):
            found = np.asarray(points, np.float64)
    return found


def _read_marker(reader: CdrReader) -> tuple[int, int, FloatArray]:
    """Read a marker; return its type, action and points (n, 3) [m]."""
    _skip_header(reader)
    reader.text()  # namespace
    _, kind, action = reader.numbers("i", 3)
    reader.skip(8, 10)  # pose, scale
    reader.skip(4, 6)  # colour, lifetime
    reader.skip(1)  # frame_locked
    points = reader.sequence("f8", 3)
    reader.sequence("f4", 4)  # colours
    reader.text()  # texture_resource
    _skip_header(reader)  # of the texture
    reader.text(), reader.sequence("u1")  # its format and data
    reader.sequence("f4", 2)  # uv_coordinates
    reader.text(), reader.text(), reader.text()  # text, mesh_resource, name of the mesh file
    reader.sequence("u1"), reader.skip(1)  # its data, mesh_use_embedded_materials
    return kind, action, points


def _skip_header(reader: CdrReader) -> None:
    reader.numbers("I", 2), reader.text()
