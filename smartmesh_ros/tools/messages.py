"""Conversions between messages and arrays, tuples or texts."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from numpy.typing import ArrayLike, NDArray
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import serialize_message
from shape_msgs.msg import MeshTriangle
from smartmesh_msgs.msg import Heightmap, MaterialLayer, TerrainMesh
from visualization_msgs.msg import Marker

from smartmesh_ros.errors import InputError, require
from smartmesh_ros.node.inputs.cdr_reader import map_from
from smartmesh_ros.node.outputs.cdr import floats, xyz
from smartmesh_ros.terrain.checked_heights import unmasked
from smartmesh_ros.yaml_text import parsed_yaml

# Depth of the queue of a subscription that must miss no message: at 60 Hz 200 last for 3 s.
DEPTH = 200
# Quality of service of a subscription that takes what any publisher offers.
BEST: dict[str, Any] = {
    "durability": DurabilityPolicy.BEST_AVAILABLE, "reliability": ReliabilityPolicy.BEST_AVAILABLE
}  # fmt: skip


def heightmap_message(
    heights: ArrayLike,
    *,
    resolution: float = 0.1,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
    frame_id: str = "map",
    tile: str = "",
    velocities: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    soil: ArrayLike | None = None,
    layers: Mapping[str, ArrayLike] = MappingProxyType({}),
    stamp: Any = None,
) -> Heightmap:
    """Return a Heightmap message from heights (rows, columns) [m], masked or NaN = a hole. ``origin`` [m]: x, y, z of
    sample (0, 0), or x, y at z = 0; ``friction``: one coefficient, or those of the samples; ``soil``: places of soils
    (rows, columns); ``layers``: further ones of the material, by name."""
    grid = unmasked(heights, "heights")
    require(grid.ndim == 2, "length", "the shape of heights", grid.shape, "(rows, columns)")
    message = Heightmap(tile=tile, heights=floats(grid))
    message.header.frame_id = frame_id
    if stamp is not None:
        message.header.stamp = stamp
    message.info.height, message.info.width = grid.shape
    message.info.resolution = float(resolution)
    message.info.origin = pose_message([*origin, 0.0][:3], yaw)
    if velocities is not None:
        message.velocities = floats(unmasked(velocities))
    if friction is not None:
        message.friction = floats(unmasked(friction))
    if soil is not None:
        message.soil = array("B", np.asarray(soil, np.uint8).tobytes())
    message.layers = [layer_message(name, values) for name, values in layers.items()]
    return message


def layer_message(name: str, values: ArrayLike) -> MaterialLayer:
    """Return a MaterialLayer message from one number, or numbers (rows, columns)."""
    return MaterialLayer(name=name, values=floats(unmasked(values)))


def mesh_message(
    vertices: ArrayLike, triangles: ArrayLike, *, frame_id: str = "map", tile: str = "", stamp: Any = None
) -> TerrainMesh:
    """Return a TerrainMesh message from vertices (V, 3) [m] and triangles (T, 3)."""
    message = TerrainMesh(tile=tile)
    message.header.frame_id = frame_id
    if stamp is not None:
        message.header.stamp = stamp
    message.mesh.vertices = [point_message(vertex) for vertex in np.asarray(vertices, np.float64).tolist()]
    message.mesh.triangles = [
        MeshTriangle(vertex_indices=corners) for corners in np.asarray(triangles, np.uint32).reshape(-1, 3)
    ]
    return message


def point_message(position: Sequence[float]) -> Point:
    """Return a Point [m]."""
    return xyz(Point, position)


def pose_message(position: Sequence[float], yaw: float = 0.0) -> Pose:
    """Return a Pose at a position [m], turned about z by ``yaw`` [rad]."""
    return Pose(position=point_message(position), orientation=Quaternion(z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw)))


def points_of(marker: Marker) -> NDArray[np.float64]:
    """Return the points (n, 3) [m] of a marker."""
    return np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)


def assert_on_map(points: NDArray[np.float64], message: Heightmap, tolerance: float = 1e-6) -> None:
    """Assert that every point (n, 3) [m] has the place and height of a sample of the map, NaN in holes, within
    ``tolerance`` [m]."""
    assert len(points), "there are no points"
    raster = map_from(serialize_message(message)).raster
    assert raster is not None, "the map is empty"
    grid = raster.geometry
    places = grid.to_grid(points[:, :2])
    cells = np.rint(places).astype(int)
    assert np.abs(places - cells).max() * grid.resolution <= tolerance, "a vertex is not at a sample's place"
    assert ((cells >= 0) & (cells <= grid.last)).all(), "a vertex is outside the map"
    expected = raster.heights[cells[:, 0], cells[:, 1]].astype(float) + grid.origin[2]
    np.testing.assert_allclose(points[:, 2], expected, 0.0, tolerance, err_msg="a vertex is not at its sample's height")


def parameter_from(name: str, text: str) -> Parameter:
    """Return a parameter with the value of a YAML text; whole numbers in a list become real ones. Raises
    `InputError`."""
    try:
        value = parsed_yaml(text)
        if isinstance(value, list):
            value = [float(item) if type(item) is int else item for item in value]
        elif type(value) is int and abs(value) >= 2**63:  # ROS has no larger whole numbers
            value = float(value)
        return Parameter(name, value=value)
    except (TypeError, ValueError, OverflowError):  # `InputError` is a ValueError
        raise InputError(
            "parameter", f"{name} cannot be {text!r}; write a number, a text, true, false, or a list of one of these"
        ) from None
