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
from smartmesh_ros.ground.quaternions import Y, about, product
from smartmesh_ros.node.inputs.optional_messages import find_message
from smartmesh_ros.node.outputs.cdr import doubles
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.sensor.range_sensors import DepthCamera, Lidar, RangeSensor
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.terrain.grid import FloatArray

NAME = "terrain_sensor"
_L, _C = Lidar(), DepthCamera()
SPECS = (
    fixed("sensor", "lidar", "Kind of sensor.", choices=("lidar", "depth_camera")),
    fixed("frame", "", "Frame that carries the sensor: of TF, or the name of a body; empty = the terrain's frame."),
    fixed("through", [], "Bodies that the rays pass through, such as the one that carries the sensor."),
    fixed("position", [*_L.position_b], "Position of the sensor in its frame (x, y, z) [m].", -1e3, 1e3),
    fixed("pitch", _L.pitch, "Angle by which the sensor looks down from the frame's x axis [rad].", -3.15, 3.15),
    fixed("rate", _L.rate, "Looks a second [Hz].", 0.01, 200.0),
    fixed("range.nearest", _L.nearest, "Closer surfaces give no return [m].", 0.0, 1e4),
    fixed("range.farthest", _L.farthest, "Farther surfaces give no return [m].", 0.01, 1e4),
    fixed("noise.constant", _L.noise_constant, "Standard deviation of a range, constant part [m].", 0.0, 10.0),
    fixed("noise.quadratic", _L.noise_quadratic, "Standard deviation of a range r, as a multiple of r^2 [1/m].", 0.0,
          10.0),
    fixed("noise.seed", 0, "Seed of the noise.", 0, 2**31 - 1),
    fixed("lidar.beams", _L.beams, "Beams, one above the other.", 1, 512),
    fixed("lidar.fan", [*_L.fan], "Elevations of the lowest and the highest beam [rad].", -1.571, 1.571),
    fixed("lidar.steps", _L.steps, "Shots of all beams in a turn.", 1, 100_000),
    fixed("lidar.sectors", 1, "Looks in a turn.", 1, 1000),
    fixed("camera.columns", _C.columns, "Columns of the image.", 2, 4096),
    fixed("camera.rows", _C.rows, "Rows of the image.", 2, 4096),
    fixed("camera.view", [*_C.view], "Horizontal and vertical angle between the outermost rays [rad].", 0.01, 3.1),
)  # fmt: skip
# Time without looks that is no reason for a warning, such as at a start [s], and number of empty clouds in a row that
# is.
GRACE, EMPTY_LOOKS = 5.0, 5
# Time after which an unanswered call is given up [s].
PATIENCE = 2.0
# Rotation from a frame that looks along x, z up, to an optical frame, which looks along z, y down.
OPTICAL = (-0.5, 0.5, -0.5, 0.5)
# Most rays of one look, as the service allows.
MOST_RAYS = 100_000
_FLOAT_SIZE = 4


def sensor_of(values: dict[str, Any]) -> RangeSensor:
    """Return the sensor that the parameters describe. Raises `InputError`."""
    for name, count in (("position", 3), ("lidar.fan", 2), ("camera.view", 2)):
        if len(values[name]) != count:
            raise InputError("parameter", f"{name} has {len(values[name])} numbers; it needs {count}")
    if not values["range.nearest"] < values["range.farthest"]:
        raise InputError("parameter", "range.nearest must be less than range.farthest")
    x, y, z = values["position"]
    common: dict[str, Any] = {
        "position_b": (x, y, z), "pitch": values["pitch"], "nearest": values["range.nearest"],
        "farthest": values["range.farthest"], "rate": values["rate"],
        "noise_constant": values["noise.constant"], "noise_quadratic": values["noise.quadratic"],
    }  # fmt: skip
    kind, group = (Lidar, "lidar.") if values["sensor"] == "lidar" else (DepthCamera, "camera.")
    own = {name.removeprefix(group): value for name, value in values.items() if name.startswith(group)}
    made: RangeSensor = kind(**common, **own)
    if (count := len(made.directions_s(0))) > MOST_RAYS:
        raise InputError("parameter", f"{count} rays in one look; at most {MOST_RAYS} are possible")
    return made


class TerrainSensor(ParameterNode):
    """Looks at the ground, at a fixed rate."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, SPECS, **node_options)
        values = self.values
        self.sensor = sensor_of(values)
        self._frame, self._through = values["frame"], values["through"]
        self._rng = np.random.default_rng(values["noise.seed"])
        self._look = 0
        self._asked: Any = None  # the call under way
        self._asked_at = 0.0
        self._looked_at = monotonic()  # when the last look succeeded, or this node started [s]
        self._empty = 0  # looks without a return, one after the other
        self._client = self.create_client(CastRays, "terrain_collider/cast_rays")
        self._points = self.create_publisher(PointCloud2, "~/points", QoSProfile(depth=5))
        self._optical = f"{self.get_fully_qualified_name().strip('/')}_optical"
        if isinstance(self.sensor, DepthCamera):
            self._image = self.create_publisher(Image, "~/image", QoSProfile(depth=5))
            self._info = self.create_publisher(CameraInfo, "~/camera_info", QoSProfile(depth=5))
        self._frames: Any = None  # publisher of the optical frame
        self.create_timer(1.0 / self.sensor.rate, self._on_time)

    def _on_time(self) -> None:
        """Cast the rays of the next look, unless the last ones are still under way."""
        now = self.get_clock().now().nanoseconds * 1e-9
        if self._asked is not None and abs(now - self._asked_at) < PATIENCE:
            self._warn("looks take longer than 1 / rate, so some are left out; lower rate or the number of rays")
            return
        if not self._client.service_is_ready():
            self._warn_late(
                f"there is no service {self._client.srv_name}; start terrain_collider, or remap the service"
            )
            return
        directions = self.sensor.directions_b(self._look)
        request = CastRays.Request(header=Header(frame_id=self._frame), range=self.sensor.farthest)
        request.origins = doubles(np.tile(self.sensor.position_b, (len(directions), 1)))
        request.directions, request.through = doubles(directions), self._through
        self._look += 1
        asked = self._asked = self._client.call_async(request)
        self._asked_at = now
        asked.add_done_callback(lambda future: self._on_answer(future, directions))

    def _on_answer(self, future: Any, directions: FloatArray) -> None:
        if future is self._asked:
            self._asked = None
        response = future.result()
        if not response.success:
            self._warn_late(f"no look: {response.message}")
            return
        self._looked_at = monotonic()
        true = np.frombuffer(response.distances, np.float64)
        known = np.isfinite(true) & (true >= self.sensor.nearest)
        self._note_returns(any_return=bool(known.any()))
        ranges = np.full(len(true), np.nan)
        deviations = self.sensor.noise_constant + self.sensor.noise_quadratic * true[known] ** 2
        ranges[known] = true[known] + deviations * self._rng.normal(size=len(deviations))
        header = response.header
        points = np.array(self.sensor.position_b) + directions[known] * ranges[known, None]
        self._points.publish(cloud_message(header, points))
        if isinstance(self.sensor, DepthCamera):
            self._publish_frame(header)
            optical = Header(stamp=header.stamp, frame_id=self._optical)
            self._image.publish(depth_image(optical, self.sensor, ranges))
            self._info.publish(camera_info(optical, self.sensor))

    def _note_returns(self, *, any_return: bool) -> None:
        """Log a line when looks have begun to meet nothing, and when one meets something again."""
        if any_return and self._empty >= EMPTY_LOOKS:
            self.get_logger().info("rays meet something again")
        self._empty = 0 if any_return else self._empty + 1
        if self._empty == EMPTY_LOOKS:
            around = f"frame {self._frame!r}" if self._frame else "the terrain's origin"
            reach = f"{self.sensor.nearest:g} to {self.sensor.farthest:g} m"
            self.get_logger().warning(
                f"clouds are empty: no ray meets anything within {reach} around {around}; is there ground below it?"
            )

    def _publish_frame(self, header: Header) -> None:
        """Publish the pose of the optical frame, once, if tf2_msgs is installed."""
        kind = find_message("tf2_msgs", "TFMessage")
        if self._frames is not None or kind is None:
            return
        self._frames = self.create_publisher(kind, "/tf_static", LATCHED)
        turn = product(about(Y, self.sensor.pitch), OPTICAL)
        x, y, z = self.sensor.position_b
        pose = Transform(
            translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(**dict(zip("xyzw", turn, strict=True)))
        )
        self._frames.publish(
            kind(transforms=[TransformStamped(header=header, child_frame_id=self._optical, transform=pose)])
        )

    def _warn_late(self, words: str) -> None:
        if monotonic() - self._looked_at > GRACE:
            self._warn(words)

    def _warn(self, words: str) -> None:
        self.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)


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
    return array.array("B", np.ascontiguousarray(values, np.float32).tobytes())


def main(args: Sequence[str] | None = None) -> None:
    answer(NAME, __doc__, SPECS, None if args is None else list(args))
    spin(TerrainSensor, args)
