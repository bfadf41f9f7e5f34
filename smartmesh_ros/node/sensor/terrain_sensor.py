"""The node ``terrain_sensor``: a lidar or a depth camera that sees the ground and the bodies of a terrain_collider.

It casts the rays of each look with the collider's service ``terrain_collider/cast_rays``, adds noise to the ranges, and
publishes the points on ``~/points`` in the frame that carries the sensor. A depth camera also publishes ``~/image``
(depths in metres, NaN = no return) and ``~/camera_info``.
"""

from __future__ import annotations

import array
import math
from collections.abc import Sequence
from time import monotonic
from typing import Any

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from smartmesh_msgs.srv import CastRays
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import Y, about, product, rotated
from smartmesh_ros.node.inputs.optional_messages import find_class
from smartmesh_ros.node.outputs.cdr import doubles, xyz
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.refusals import GRACE, LOG_PERIOD
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.terrain.grid import FloatArray

NAME = "terrain_sensor"
# The noise of a range r is normal. Its constant part comes from the clock or the lens, the quadratic one from
# triangulation and weak echoes: by default 1 cm near by, and 3 cm at 15 m. Most beams of the lidar look downwards, as
# on ground robots; the camera is a usual short-base one, thinned out to what a mapper keeps of it.
SPECS = (
    fixed("sensor", "lidar", "Kind of sensor.", choices=("lidar", "depth_camera")),
    fixed("frame", "", "Frame that carries the sensor: of TF, or the name of a body; empty = the terrain's frame."),
    fixed("through", [], "Bodies that the rays pass through, such as the one that carries the sensor."),
    fixed("position", [0.0, 0.0, 0.8], "Position of the sensor in its frame (x, y, z) [m].", -1e3, 1e3),
    fixed("pitch", 0.0, "Angle by which the sensor looks down from the frame's x axis [rad].", -3.15, 3.15),
    fixed("rate", 10.0, "Looks a second [Hz].", 0.01, 200.0),
    fixed("range.nearest", 0.5, "Closer surfaces give no return [m].", 0.0, 1e4),
    fixed("range.farthest", 15.0, "Farther surfaces give no return [m].", 0.01, 1e4),
    fixed("noise.constant", 0.01, "Standard deviation of a range, constant part [m].", 0.0, 10.0),
    fixed("noise.quadratic", 0.0001, "Standard deviation of a range r, as a multiple of r^2 [1/m].", 0.0, 10.0),
    fixed("noise.seed", 0, "Seed of the noise.", 0, 2**31 - 1),
    fixed("lidar.beams", 16, "Beams, one above the other.", 1, 512),
    fixed("lidar.fan", [math.radians(-30.0), math.radians(10.0)],
          "Elevations of the lowest and the highest beam [rad].", -1.571, 1.571),
    fixed("lidar.steps", 360, "Shots of all beams in a turn.", 1, 100_000),
    fixed("lidar.sectors", 1, "Looks in a turn.", 1, 1000),
    fixed("camera.columns", 64, "Columns of the image.", 2, 4096),
    fixed("camera.rows", 48, "Rows of the image.", 2, 4096),
    fixed("camera.view", [math.radians(87.0), math.radians(58.0)],
          "Horizontal and vertical angle between the outermost rays [rad].", 0.01, 3.1),
)  # fmt: skip
# Number of empty clouds in a row that is reason for a warning.
EMPTY_LOOKS = 5
# Time after which an unanswered call is given up [s].
PATIENCE = 2.0
# Rotation from a frame that looks along x, z up, to an optical frame, which looks along z, y down.
OPTICAL = (-0.5, 0.5, -0.5, 0.5)
# Most rays of one look, as the service allows.
MOST_RAYS = 100_000
_FLOAT_SIZE = 4


def directions_of(values: dict[str, Any], look: int) -> FloatArray:
    """Return unit directions (n, 3) of the rays of the look of that number, for the values of the parameters: x
    forwards, z up. Those of a camera are row by row from the upper left, those of a lidar, whose turn consists of
    ``lidar.sectors`` looks, beam by beam from the lowest."""
    if values["sensor"] == "depth_camera":
        wide, high = (math.tan(0.5 * angle) for angle in values["camera.view"])
        columns, rows = values["camera.columns"], values["camera.rows"]
        left, up = np.meshgrid(np.linspace(wide, -wide, columns), np.linspace(high, -high, rows))
        rays = np.stack([np.ones_like(left), left, up], axis=-1).reshape(-1, 3)
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    (lowest, highest), steps, sectors = values["lidar.fan"], values["lidar.steps"], values["lidar.sectors"]
    shots = np.arange(look * steps // sectors, (look + 1) * steps // sectors)
    beams = np.linspace(lowest, highest, values["lidar.beams"])
    azimuth, rise = np.meshgrid(shots * (2.0 * math.pi / steps), beams)
    flat = np.cos(rise)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(rise)], axis=-1).reshape(-1, 3)


def require_sensor(values: dict[str, Any]) -> None:
    """Raise `InputError` unless the values of the parameters describe a sensor."""
    for name, count in (("position", 3), ("lidar.fan", 2), ("camera.view", 2)):
        if len(values[name]) != count:
            raise InputError("parameter", f"{name} has {len(values[name])} numbers; it needs {count}")
    if not values["range.nearest"] < values["range.farthest"]:
        raise InputError("parameter", "range.nearest must be less than range.farthest")
    if (count := len(directions_of(values, 0))) > MOST_RAYS:
        raise InputError("parameter", f"{count} rays in one look; at most {MOST_RAYS} are possible")


class TerrainSensor(ParameterNode):
    """Looks at the ground, at a fixed rate."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        require_sensor(self.values)
        self._rng = np.random.default_rng(self.values["noise.seed"])
        self._pitch, self._position = about(Y, self.values["pitch"]), self.values["position"]
        self._look = 0
        self._asked: Any = None  # the call under way
        self._asked_at = 0.0
        self._looked_at = monotonic()  # when the last look succeeded, or this node started [s]
        self._empty = 0  # looks without a return, one after the other
        self._client = self.create_client(CastRays, "terrain_collider/cast_rays")
        self._points = self.create_publisher(PointCloud2, "~/points", QoSProfile(depth=5))
        self._optical = f"{self.get_fully_qualified_name().strip('/')}_optical"
        self._is_camera = self.values["sensor"] == "depth_camera"
        if self._is_camera:
            self._image = self.create_publisher(Image, "~/image", QoSProfile(depth=5))
            self._info = self.create_publisher(CameraInfo, "~/camera_info", QoSProfile(depth=5))
        self._frames: Any = None  # publisher of the optical frame
        self.create_timer(1.0 / self.values["rate"], self._on_time)

    def _on_time(self) -> None:
        """Cast the rays of the next look, unless the last ones are still under way."""
        now = self.get_clock().now().nanoseconds * 1e-9
        if self._asked is not None and abs(now - self._asked_at) < PATIENCE:
            words = "looks take longer than 1 / rate, so some are left out; lower rate or the number of rays"
            self.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)
            return
        if not self._client.service_is_ready():
            self._warn_late(
                f"there is no service {self._client.srv_name}; start terrain_collider, or remap the service"
            )
            return
        directions = self.directions_b(self._look)
        request = CastRays.Request(header=Header(frame_id=self.values["frame"]), range=self.values["range.farthest"])
        request.origins = doubles(np.tile(self._position, (len(directions), 1)))
        request.directions, request.through = doubles(directions), self.values["through"]
        self._look += 1
        asked = self._asked = self._client.call_async(request)
        self._asked_at = now
        asked.add_done_callback(lambda future: self._on_answer(future, directions))

    def directions_b(self, look: int) -> FloatArray:
        """Return the directions (n, 3) of a look in the frame that carries the sensor."""
        return rotated(np.array(self._pitch), directions_of(self.values, look))

    def _on_answer(self, future: Any, directions: FloatArray) -> None:
        if future is self._asked:
            self._asked = None
        response = future.result()
        if not response.success:
            self._warn_late(f"no look: {response.message}")
            return
        self._looked_at = monotonic()
        true = np.frombuffer(response.distances, np.float64)
        known = np.isfinite(true) & (true >= self.values["range.nearest"])
        self._note_returns(any_return=bool(known.any()))
        ranges = np.full(len(true), np.nan)
        deviations = self.values["noise.constant"] + self.values["noise.quadratic"] * true[known] ** 2
        ranges[known] = true[known] + deviations * self._rng.normal(size=len(deviations))
        header = response.header
        points = np.array(self._position) + directions[known] * ranges[known, None]
        self._points.publish(cloud_message(header, points))
        if self._is_camera:
            self._publish_frame(header)
            optical = Header(stamp=header.stamp, frame_id=self._optical)
            self._image.publish(depth_image(optical, self.values, ranges))
            self._info.publish(camera_info(optical, self.values))

    def _note_returns(self, *, any_return: bool) -> None:
        """Log a line when looks have begun to meet nothing, and when one meets something again."""
        if any_return and self._empty >= EMPTY_LOOKS:
            self.get_logger().info("rays meet something again")
        self._empty = 0 if any_return else self._empty + 1
        if self._empty == EMPTY_LOOKS:
            frame = self.values["frame"]
            around = f"frame {frame!r}" if frame else "the terrain's origin"
            reach = f"{self.values['range.nearest']:g} to {self.values['range.farthest']:g} m"
            self.get_logger().warning(
                f"clouds are empty: no ray meets anything within {reach} around {around}; is there ground below it?"
            )

    def _publish_frame(self, header: Header) -> None:
        """Publish the pose of the optical frame, once, if tf2_msgs is installed."""
        kind = find_class("tf2_msgs/msg/TFMessage")
        if self._frames is not None or kind is None:
            return
        self._frames = self.create_publisher(kind, "/tf_static", LATCHED)
        turn = xyz(Quaternion, product(self._pitch, OPTICAL))
        pose = Transform(translation=xyz(Vector3, self._position), rotation=turn)
        self._frames.publish(
            kind(transforms=[TransformStamped(header=header, child_frame_id=self._optical, transform=pose)])
        )

    def _warn_late(self, words: str) -> None:
        if monotonic() - self._looked_at > GRACE:
            self.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)  # by the line of code: each has its own


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


def depth_image(header: Header, values: dict[str, Any], ranges: FloatArray) -> Image:
    """Return ranges (rows * columns,) [m], NaN = no return, as an image of depths along the optical axis [m]."""
    columns = values["camera.columns"]
    return Image(
        header=header, height=values["camera.rows"], width=columns, encoding="32FC1", is_bigendian=0,
        step=_FLOAT_SIZE * columns, data=_bytes(ranges * directions_of(values, 0)[:, 0]),
    )  # fmt: skip


def camera_info(header: Header, values: dict[str, Any]) -> CameraInfo:
    """Return the pinhole model of a camera; its outermost rays pass through the middles of the outermost pixels."""
    columns, rows = values["camera.columns"], values["camera.rows"]
    wide, high = (math.tan(0.5 * angle) for angle in values["camera.view"])
    middle_x, middle_y = 0.5 * (columns - 1), 0.5 * (rows - 1)
    fx, fy = middle_x / wide, middle_y / high
    return CameraInfo(
        header=header, height=rows, width=columns, distortion_model="plumb_bob",
        d=array.array("d", [0.0] * 5), k=np.array([fx, 0.0, middle_x, 0.0, fy, middle_y, 0.0, 0.0, 1.0]),
        r=np.eye(3).ravel(),
        p=np.array([fx, 0.0, middle_x, 0.0, 0.0, fy, middle_y, 0.0, 0.0, 0.0, 1.0, 0.0]),
    )  # fmt: skip


def _bytes(values: FloatArray) -> array.array[int]:
    return array.array("B", np.ascontiguousarray(values, np.float32).tobytes())


def main(args: Sequence[str] | None = None) -> None:
    answer(NAME, __doc__, SPECS, args)
    spin(TerrainSensor, args)
