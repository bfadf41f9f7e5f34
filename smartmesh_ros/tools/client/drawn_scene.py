"""What a client reads from ``~/scene``: the ground, if it has no map of it, and tracked bodies, whose poses may be on
topics and in frames that it does not know."""

from __future__ import annotations

import numpy as np
from visualization_msgs.msg import Marker

from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client.sight import Pose


def drawn_scene(scene: bytes) -> tuple[FloatArray | None, list[Pose]]:
    """Return the corners (n, 3) [m] of the triangles of ground in a MarkerArray, none if the ground is gone, None = it
    has not changed; and the markers of tracked bodies, which alone are translucent. Raises `InputError` if the bytes
    are malformed.

    Reads the bytes, because rclpy takes 50 ms to make an object of each corner."""
    reader, ground, tracked = CdrReader(scene), None, list[Pose]()
    for _ in range(reader.count(1)):
        _skip_header(reader)
        namespace = reader.text()
        _, kind, action = reader.numbers("i", 3)
        x, y, z, qx, qy, qz, qw, *_ = reader.numbers("d", 10)
        *_, alpha = reader.numbers("f", 4)
        reader.skip(4, 2)  # lifetime
        reader.skip(1)  # frame_locked
        points = reader.sequence("f8", 3)
        reader.sequence("f4", 4)  # colours
        reader.text()  # texture_resource
        _skip_header(reader)  # of the texture
        reader.text(), reader.sequence("u1")  # its format and data
        reader.sequence("f4", 2)  # uv_coordinates
        reader.text(), reader.text(), reader.text()  # text, mesh_resource, name of the mesh file
        reader.sequence("u1"), reader.skip(1)  # its data, mesh_use_embedded_materials
        if action == Marker.DELETEALL and namespace.endswith("ground"):
            ground = np.empty((0, 3))
        if action != Marker.ADD:
            continue
        if kind == Marker.TRIANGLE_LIST:
            ground = np.asarray(points, np.float64)
        elif alpha < 1.0:
            tracked.append(Pose((x, y, z), (qw, qx, qy, qz)))
    return ground, tracked


def _skip_header(reader: CdrReader) -> None:
    reader.numbers("I", 2), reader.text()
