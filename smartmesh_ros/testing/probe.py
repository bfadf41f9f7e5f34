"""A probe: the node of a test, which publishes inputs, calls services and keeps what it receives."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from numpy.typing import ArrayLike, NDArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import (
    ColliderPatchArray,
    ContactArray,
    ContactWrenchArray,
    Heightmap,
    HeightmapUpdate,
    TerrainMesh,
    TerrainMeshUpdate,
    Timing,
    TrackedBody,
    TrackedBodyArray,
)
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.testing.messages import heightmap_message, points_of, pose_message
from smartmesh_ros.testing.process import PATIENCE, STARTING, Process
from smartmesh_ros.testing.report import of_wait

COLLIDER = "/terrain_collider"
DIAGNOSTICS = "/diagnostics"
# Below the node's name. A probe listens to the first from the start, and to the others once it is asked for them.
_OUTPUTS = {
    "patches": MarkerArray,
    "collider_patches": ColliderPatchArray,
    "body_states": TrackedBodyArray,
    "contacts": ContactArray,
    "timing": Timing,
}
_MORE_OUTPUTS = {"joint_states": JointState, "odometry": Odometry, "contact_wrenches": ContactWrenchArray}
_INPUTS = {
    "heightmap": Heightmap,
    "heightmap_update": HeightmapUpdate,
    "terrain_mesh": TerrainMesh,
    "terrain_mesh_update": TerrainMeshUpdate,
    "tracked_bodies": TrackedBodyArray,
    "body_poses": PoseArray,
}
# Answers that may wait while the probe takes something else: by default ROS loses all but ten.
_CALLS = QoSProfile(depth=1000)
# How the diagnostics name the number of publishers of a topic.
_PUBLISHERS = "publishers of "


class Probe:
    """Publishes inputs of ``<namespace>/terrain_collider``, calls its services and keeps what it publishes.

    ``received``: messages by whole topic. A context manager.
    """

    def __init__(self, namespace: str = "") -> None:
        self.namespace = "/" + namespace.strip("/") if namespace.strip("/") else ""
        self.collider = self.namespace + COLLIDER
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("probe", context=self.context)
        self.received: dict[str, list[Any]] = defaultdict(list)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._services: dict[str, Any] = {}
        self._processes: list[Process] = []
        self.publishers = {
            topic: self.node.create_publisher(kind, self.topic(topic), 10) for topic, kind in _INPUTS.items()
        }
        self._kinds: dict[str, Any] = {}
        for topic, kind in _OUTPUTS.items():
            self.listen(topic, kind)
        self.listen(DIAGNOSTICS, DiagnosticArray)

    def __enter__(self) -> Probe:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the probe."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def topic(self, name: str) -> str:
        """Return a whole name: of a topic or service below the collider's, or as it is where it starts with ``/``."""
        return name if name.startswith("/") else f"{self.collider}/{name}"

    def listen(self, topic: str, kind: Any, qos: Any = 100) -> list[Any]:
        """Subscribe to a topic; returns the list that its messages are added to."""
        name = self.topic(topic)
        if name not in self._kinds:
            self._kinds[name] = kind
            self.node.create_subscription(kind, name, self.received[name].append, qos)
        return self.received[name]

    @contextmanager
    def running(
        self,
        name: str = "terrain_collider",
        parameters: dict[str, Any] | None = None,
        arguments: Sequence[str] = (),
        *,
        package: str = "smartmesh_ros",
        environment: dict[str, str] | None = None,
        timeout: float = STARTING,
    ) -> Iterator[Process]:
        """An executable of a package for the length of the block, in the probe's namespace.

        The collider is connected to the probe when the block begins; of others the probe cannot know when they are. It
        is waited for up to ``timeout`` [s], and no longer than it runs: a first start may have to compile.
        """
        if self.namespace:
            arguments = [*arguments, "--ros-args", "-r", f"__ns:={self.namespace}", "--"]
        with Process(name, parameters, arguments, package=package, environment=environment) as process:
            self._processes.append(process)
            try:
                if (package, name) == ("smartmesh_ros", "terrain_collider"):
                    self.wait_for(self.connected, timeout=timeout, watch=process)
                yield process
            finally:
                self._processes.remove(process)
                for messages in self.received.values():
                    messages.clear()

    def publisher(self, kind: Any, topic: str, qos: Any = 10) -> Any:
        """Return a publisher of messages ``kind`` on ``topic`` (a name below the collider's, or a whole one) that is connected
        with somebody, and with the collider if it listens there."""
        publisher = self.node.create_publisher(kind, self.topic(topic), qos)
        self.wait_for(lambda: publisher.get_subscription_count() and self._heard([publisher]))
        return publisher

    def connected(self) -> bool:
        """Whether the collider has met every publisher and subscription of the probe."""
        count = self.node.count_publishers
        publishers = list(self.publishers.values())
        return (
            all(publisher.get_subscription_count() for publisher in publishers)
            and all(count(self.topic(topic)) for topic in (*_OUTPUTS, DIAGNOSTICS))
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
        for message in reversed(self.received[DIAGNOSTICS]):
            if counts := _publishers_by_topic(message, self.collider):
                return counts
        return {}

    def spin(self, seconds: float = 0.02) -> None:
        """Handle what has arrived."""
        self._executor.spin_once(timeout_sec=seconds)

    def wait_for(self, condition: Callable[[], Any], *, timeout: float = PATIENCE, watch: Process | None = None) -> Any:
        """Spin until the condition holds and returns its value; fails with what is known of why it does not."""
        end = monotonic() + timeout
        while not (value := condition()):
            if watch is not None and watch.process.poll() is not None:
                raise AssertionError(f"the node ended with {watch.process.returncode}: {watch.output}")
            if monotonic() > end:
                raise AssertionError(of_wait(timeout, self.node, self.received, self._processes))
            self.spin()
        return value

    def latest(self, topic: str) -> Any:
        """Return the newest message of an output (a name below the collider's, or a whole one) that comes from now on."""
        if topic in _MORE_OUTPUTS:
            self.listen(topic, _MORE_OUTPUTS[topic])
        messages = self.received[self.topic(topic)]
        seen = len(messages)
        self.wait_for(lambda: len(messages) > seen)
        return messages[-1]

    def client(self, service: str, kind: Any) -> Any:
        """Return a client of a service of the collider (or a whole name), which is there."""
        name = self.topic(service)
        if name not in self._services:
            self._services[name] = self.node.create_client(kind, name, qos_profile=_CALLS)
        self.wait_for(self._services[name].service_is_ready)
        return self._services[name]

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        """Call a service of the collider (or a whole name) and returns its response."""
        future = self.client(service, kind).call_async(kind.Request(**fields))
        self.wait_for(future.done)
        return future.result()

    def publish_map(self, heights: ArrayLike, **options: Any) -> Heightmap:
        """Publish a map; options as `heightmap_message`."""
        message = heightmap_message(heights, stamp=options.pop("stamp", self.now()), **options)
        self.publishers["heightmap"].publish(message)
        return message

    def publish_poses(self, positions: Sequence[Sequence[float]], frame_id: str = "map") -> None:
        """Publish positions [m] of the bodies ``body_0``, ``body_1``, ..."""
        message = PoseArray()
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        message.poses = [pose_message(position) for position in positions]
        self.publishers["body_poses"].publish(message)

    def publish_bodies(self, bodies: dict[str, Sequence[float]], radius: float = 0.0, frame_id: str = "map") -> None:
        """Publish tracked bodies by name and position [m]."""
        message = TrackedBodyArray()
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        message.bodies = [
            TrackedBody(id=name, pose=pose_message(position), radius=radius) for name, position in bodies.items()
        ]
        self.publishers["tracked_bodies"].publish(message)

    def now(self) -> Any:
        """Return the time of the probe's clock, as a stamp."""
        return self.node.get_clock().now().to_msg()

    def patches(self) -> dict[int, NDArray[np.float64]]:
        """Vertice (n, 3) [m] of the newest markers, by marker id."""
        markers = self.latest("patches").markers
        return {marker.id: points_of(marker) for marker in markers if marker.action == Marker.ADD}

    def diagnostics(self, task: str) -> dict[str, str]:
        """Values of a task of the collider's newest diagnostics, and its ``message``."""
        while not _publishers_by_topic(message := self.latest(DIAGNOSTICS), self.collider):
            pass  # another node's
        [status] = [status for status in message.status if status.name == f"terrain_collider: {task}"]
        return {pair.key: pair.value for pair in status.values} | {"message": status.message}


def _publishers_by_topic(message: DiagnosticArray, collider: str) -> dict[str, int]:
    """Numbers of publishers by topic of a message of ``collider``, empty where it is another node's."""
    for status in message.status:
        if status.name.endswith(": connections"):
            counts = {pair.key: int(pair.value) for pair in status.values if pair.key.startswith(_PUBLISHERS)}
            # Peers of the collider listen to its states, and to nothing else of it.
            if any(key.startswith(f"{_PUBLISHERS}{collider}/") and not key.endswith("/body_states") for key in counts):
                return counts
    return {}
