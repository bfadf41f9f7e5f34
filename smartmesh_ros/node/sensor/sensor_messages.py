"""Messages of a sensor of ranges."""

from __future__ import annotations

import array
import math

import numpy as np
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from smartmesh_ros.node.sensor.range_sensors import DepthCamera
from smartmesh_ros.terrain.grid import FloatArray

_FLOAT_SIZE = 4


def cloud_message(header: Header, points: FloatArray) -> PointCloud2:
    """Return points (N, 3) [m] as a cloud with fields x, y, z."""
    fields = [
        PointField(name=name, offset=index * _FLOAT_SIZE, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate("xyz")
    ]
    step = len(fields) * _FLOAT_SIZE
    return PointCloud2(
        header=header, height=1, width=len(points), fields=fields, is_bigendian=False, point_step=step,
        row_step=step * len(points), data=_bytes(points), is_dense=True,
    )  # fmt: skip


def depth_image(header: Header, camera: DepthCamera, ranges: FloatArray) -> Image:
    """Return ranges (rows * columns,) [m], NaN = no return, as an image of depths along the optical axis [m]."""
    depths = ranges * camera.directions_s(0)[:, 0]
    return Image(
        header=header, height=camera.rows, width=camera.columns, encoding="32FC1", is_bigendian=0,
        step=_FLOAT_SIZE * camera.columns, data=_bytes(depths),
    )  # fmt: skip


def camera_info(header: Header, camera: DepthCamera) -> CameraInfo:
    """Return the pinhole model of a camera; its outermost rays pass through the middles of the outermost pixels."""
    wide, high = (math.tan(0.5 * angle) for angle in camera.view)
    middle_x, middle_y = 0.5 * (camera.columns - 1), 0.5 * (camera.rows - 1)
    fx, fy = middle_x / wide, middle_y / high
    return CameraInfo(
        header=header, height=camera.rows, width=camera.columns, distortion_model="plumb_bob",
        d=array.array("d", [0.0] * 5), k=np.array([fx, 0.0, middle_x, 0.0, fy, middle_y, 0.0, 0.0, 1.0]),
        r=np.eye(3).ravel(),
        p=np.array([fx, 0.0, middle_x, 0.0, 0.0, fy, middle_y, 0.0, 0.0, 0.0, 1.0, 0.0]),
    )  # fmt: skip


def _bytes(values: FloatArray) -> array.array[int]:
    result = array.array("B")
    result.frombytes(np.ascontiguousarray(values, np.float32).tobytes())
    return result
