"""Topic-driven integration tests: a node of this package in a process and DDS domain of its own, and a probe beside it.

docs/testing.md is the guide to it. With pytest, import the fixtures and ask for them::

    from smartmesh_ros.testing import Probe, domain, probe  # noqa: F401

    def test_patches_lie_on_my_map(probe: Probe) -> None:
        with probe.running("terrain_collider", {"publish.patches": 60.0}):
            probe.publish_map(np.zeros((50, 50)), resolution=0.1)
            probe.publish_poses([(2.5, 2.5, 0.3)])
            probe.wait_for(lambda: probe.patches().keys() == {0})

Everything waits for conditions and gives up after a generous time; nothing sleeps for a fixed time.
"""

from __future__ import annotations

import array
import math
import os
import signal
import socket
import subprocess
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Pose, PoseArray
from numpy.typing import ArrayLike, NDArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from shape_msgs.msg import MeshTriangle
from smartmesh_msgs.msg import (
    ColliderPatchArray,
    ContactArray,
    Heightmap,
    HeightmapUpdate,
    TerrainMesh,
    TerrainMeshUpdate,
    Timing,
    TrackedBody,
    TrackedBodyArray,
)
from visualization_msgs.msg import Marker, MarkerArray

# How long conditions may take [s]: far longer than on an idle machine.
PATIENCE = 30.0
COLLIDER = "/terrain_collider"
_OUTPUTS = {
    f"{COLLIDER}/patches": MarkerArray,
    f"{COLLIDER}/collider_patches": ColliderPatchArray,
    f"{COLLIDER}/body_states": TrackedBodyArray,
    f"{COLLIDER}/contacts": ContactArray,
    f"{COLLIDER}/timing": Timing,
    "/diagnostics": DiagnosticArray,
}
# How the diagnostics name the number of publishers of a topic.
_PUBLISHERS = "publishers of "
_INPUTS = {
    "heightmap": Heightmap,
    "heightmap_update": HeightmapUpdate,
    "terrain_mesh": TerrainMesh,
    "terrain_mesh_update": TerrainMeshUpdate,
    "tracked_bodies": TrackedBodyArray,
    "body_poses": PoseArray,
}


def executable(name: str, package: str = "smartmesh_ros") -> Path:
    """Path of an installed executable, looked up in the ament index as ``ros2 run`` does."""
    path = Path(get_package_prefix(package)) / "lib" / package / name
    if not path.is_file():
        raise FileNotFoundError(f"package {package} has no executable {name}; build and source the workspace")
    return path


class Process:
    """A node in a process of its own, its output kept."""

    def __init__(
        self,
        name: str,
        parameters: dict[str, Any] | None = None,
        arguments: Sequence[str] = (),
        *,
        package: str = "smartmesh_ros",
        environment: dict[str, str] | None = None,
    ) -> None:
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        command = [str(executable(name, package)), *arguments]
        if parameters:
            file = folder / "parameters.yaml"
            file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
            command += ["--ros-args", "--params-file", str(file)]
        environment = {**os.environ, **(environment or {})}
        self._log = folder / "log.txt"
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)

    @property
    def output(self) -> str:
        """What it has printed so far."""
        return self._log.read_text(errors="replace")

    def stop(self, number: int = signal.SIGINT) -> int:
        """Sends a signal, waits for the end and returns the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        """Ends it whatever it takes."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._folder.cleanup()


class Probe:
    """A ROS node of the test: publishes inputs, calls services and keeps what it receives."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("probe", context=self.context)
        self.received: dict[str, list[Any]] = defaultdict(list)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._services: dict[str, Any] = {}
        self.publishers = {
            topic: self.node.create_publisher(kind, f"{COLLIDER}/{topic}", 10) for topic, kind in _INPUTS.items()
        }
        for topic, kind in _OUTPUTS.items():
            self.node.create_subscription(kind, topic, self.received[topic].append, 100)

    def close(self) -> None:
        """Ends the probe."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    @contextmanager
    def running(
        self,
        name: str = "terrain_collider",
        parameters: dict[str, Any] | None = None,
        arguments: Sequence[str] = (),
    ) -> Iterator[Process]:
        """A node of the package, connected to the probe, for the length of the block."""
        process = Process(name, parameters, arguments)
        try:
            if name == "terrain_collider":
                self.wait_for(self.connected, watch=process)
            yield process
        finally:
            process.stop()
            process.close()
            for messages in self.received.values():
                messages.clear()

    def publisher(self, kind: Any, topic: str, qos: Any = 10) -> Any:
        """A publisher of messages ``kind`` on ``topic`` (a name below /terrain_collider, or a whole one) that is
        connected with somebody, and with the collider if it listens there."""
        name = topic if topic.startswith("/") else f"{COLLIDER}/{topic}"
        publisher = self.node.create_publisher(kind, name, qos)
        self.wait_for(lambda: publisher.get_subscription_count() and self._heard([publisher]))
        return publisher

    def connected(self) -> bool:
        """Whether the collider has met every publisher and subscription of the probe."""
        count = self.node.count_publishers
        publishers = list(self.publishers.values())
        return (
            all(publisher.get_subscription_count() for publisher in publishers)
            and all(count(topic) for topic in _OUTPUTS)
            and bool(self._counts())
            and self._heard(publishers)
        )

    def _heard(self, publishers: Sequence[Any]) -> bool:
        """Whether the collider says that it is connected to publishers on the topics of these, as far as it listens
        there.

        That a publisher has found a subscription is not enough: until that has found the publisher too, what is
        published without guarantee (the bodies' poses) is lost.
        """
        counts = self._counts()
        return all(counts.get(_PUBLISHERS + publisher.topic_name, 1) for publisher in publishers)

    def _counts(self) -> dict[str, int]:
        """Numbers of publishers by topic in the collider's newest diagnostics, empty before the first."""
        for message in reversed(self.received["/diagnostics"]):
            for status in message.status:
                if status.name.endswith(": connections"):
                    return {pair.key: int(pair.value) for pair in status.values if pair.key.startswith(_PUBLISHERS)}
        return {}

    def spin(self, seconds: float = 0.02) -> None:
        """Handles what has arrived."""
        self._executor.spin_once(timeout_sec=seconds)

    def wait_for(self, condition: Callable[[], Any], *, timeout: float = PATIENCE, watch: Process | None = None) -> Any:
        """Spins until the condition holds and returns its value; fails with what was received last."""
        end = monotonic() + timeout
        while not (value := condition()):
            if watch is not None and watch.process.poll() is not None:
                raise AssertionError(f"the node ended with {watch.process.returncode}: {watch.output}")
            if monotonic() > end:
                counts = {topic: len(messages) for topic, messages in self.received.items()}
                raise AssertionError(f"waited {timeout:.0f} s in vain; received {counts}")
            self.spin()
        return value

    def latest(self, topic: str) -> Any:
        """The newest message of ``topic`` (a name below /terrain_collider, or a whole one) that comes from now on."""
        messages = self.received[topic if topic.startswith("/") else f"{COLLIDER}/{topic}"]
        seen = len(messages)
        self.wait_for(lambda: len(messages) > seen)
        return messages[-1]

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        """Calls a service of the collider (or a whole name) and returns its response."""
        name = service if service.startswith("/") else f"{COLLIDER}/{service}"
        if name not in self._services:
            self._services[name] = self.node.create_client(kind, name)
        client = self._services[name]
        self.wait_for(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        self.wait_for(future.done)
        return future.result()

    def publish_map(self, heights: ArrayLike, **options: Any) -> Heightmap:
        """Publishes a map; options as `heightmap_message`."""
        message = heightmap_message(heights, stamp=options.pop("stamp", self.now()), **options)
        self.publishers["heightmap"].publish(message)
        return message

    def publish_poses(self, positions: Sequence[Sequence[float]], frame_id: str = "map") -> None:
        """Publishes positions [m] of the bodies ``body_0``, ``body_1``, ..."""
        message = PoseArray()
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        message.poses = [pose_message(position) for position in positions]
        self.publishers["body_poses"].publish(message)

    def publish_bodies(self, bodies: dict[str, Sequence[float]], radius: float = 0.0, frame_id: str = "map") -> None:
        """Publishes tracked bodies by name and position [m]."""
        message = TrackedBodyArray()
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        message.bodies = [
            TrackedBody(id=name, pose=pose_message(position), radius=radius) for name, position in bodies.items()
        ]
        self.publishers["tracked_bodies"].publish(message)

    def now(self) -> Any:
        """The time of the probe's clock, as a stamp."""
        return self.node.get_clock().now().to_msg()

    def patches(self) -> dict[int, NDArray[np.float64]]:
        """Vertices (n, 3) [m] of the newest markers, by marker id."""
        markers = self.latest("patches").markers
        return {marker.id: points_of(marker) for marker in markers if marker.action == Marker.ADD}

    def diagnostics(self, task: str) -> dict[str, str]:
        """Values of a task of the newest diagnostics."""
        statuses = self.latest("/diagnostics").status
        [status] = [status for status in statuses if status.name == f"terrain_collider: {task}"]
        return {pair.key: pair.value for pair in status.values} | {"message": status.message}


def assert_cannot_start(
    parameters: dict[str, Any], words: str, *, name: str = "terrain_collider", environment: dict[str, str] | None = None
) -> None:
    """Asserts that a node of this package ends at once with exit code 2 and says why, in ``words``."""
    process = Process(name, parameters, environment=environment)
    try:
        assert process.process.wait(PATIENCE) == 2, process.output
        assert words in process.output, process.output
        assert "Traceback" not in process.output, process.output
    finally:
        process.close()


def heightmap_message(
    heights: ArrayLike,
    *,
    resolution: float = 0.1,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
    frame_id: str = "map",
    tile: str = "",
    velocities: ArrayLike | None = None,
    stamp: Any = None,
) -> Heightmap:
    """A Heightmap message from heights (rows, columns) [m]."""
    grid = np.asarray(heights, np.float32)
    message = Heightmap(tile=tile, heights=floats(grid))
    message.header.frame_id = frame_id
    if stamp is not None:
        message.header.stamp = stamp
    message.info.height, message.info.width = grid.shape
    message.info.resolution = resolution
    message.info.origin = pose_message(origin)
    message.info.origin.orientation.z, message.info.origin.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    if velocities is not None:
        message.velocities = floats(np.asarray(velocities, np.float32))
    return message


def mesh_message(
    vertices: ArrayLike, triangles: ArrayLike, *, frame_id: str = "map", tile: str = "", stamp: Any = None
) -> TerrainMesh:
    """A TerrainMesh message from vertices (V, 3) [m] and triangles (T, 3)."""
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
    """A Point [m]."""
    x, y, z = position
    return Point(x=float(x), y=float(y), z=float(z))


def pose_message(position: Sequence[float]) -> Pose:
    """A Pose at a position [m], not turned."""
    return Pose(position=point_message(position))


def floats(values: NDArray[np.float32]) -> array.array[float]:
    """Values for a float32[] field, without converting them one by one."""
    result = array.array("f")
    result.frombytes(np.ascontiguousarray(values, np.float32).tobytes())
    return result


def points_of(marker: Marker) -> NDArray[np.float64]:
    """Points (n, 3) [m] of a marker."""
    return np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)


def assert_on_map(points: NDArray[np.float64], message: Heightmap, tolerance: float = 1e-6) -> None:
    """Asserts that every point (n, 3) [m] is a sample of the map: at its place, and at its height."""
    info = message.info
    q, origin = info.origin.orientation, info.origin.position
    yaw = 2.0 * math.atan2(q.z, q.w)
    offset = points[:, :2] - (origin.x, origin.y)
    column = (offset @ (math.cos(yaw), math.sin(yaw))) / info.resolution
    row = (offset @ (-math.sin(yaw), math.cos(yaw))) / info.resolution
    cells = np.rint([row, column]).astype(int)
    assert np.abs([row, column] - cells).max() * info.resolution <= tolerance, "a vertex is not at a sample's place"
    assert cells.min() >= 0, "a vertex is outside the map"
    heights = np.frombuffer(message.heights, np.float32).reshape(info.height, info.width)
    expected = heights[cells[0], cells[1]].astype(float) + origin.z
    assert np.abs(points[:, 2] - expected).max() <= tolerance, "a vertex is not at its sample's height"


@pytest.fixture(scope="session")
def domain() -> Iterator[int]:
    """A DDS domain that no other test on this machine uses at the time, limited to this machine."""
    for number in range(1, 100):
        lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            lock.bind(("127.0.0.1", 24700 + number))
        except OSError:
            lock.close()
            continue
        saved = {name: os.environ.get(name) for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")}
        os.environ.update(ROS_DOMAIN_ID=str(number), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
        yield number
        for name, value in saved.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
        lock.close()
        return
    raise RuntimeError("no free DDS domain between 1 and 99")


@pytest.fixture
def probe(domain: int) -> Iterator[Probe]:
    """A probe in the test's domain."""
    made = Probe()
    yield made
    made.close()
