"""A probe: the node of a test, which publishes inputs, calls services and records the messages it receives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from numpy.typing import ArrayLike, NDArray
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import try_shutdown
from smartmesh_msgs import msg
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.errors import suggestion
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.tools.messages import BEST, heightmap_message, points_of, pose_message
from smartmesh_ros.tools.replay.bag import type_of
from smartmesh_ros.tools.testing.process import START_TIMEOUT, TIMEOUT, Process

COLLIDER = "/terrain_collider"
DIAGNOSTICS = "/diagnostics"
# Topics below the collider's name. A probe subscribes to `_OUTPUTS` at once.
_OUTPUTS = {
    "patches": MarkerArray,
    "collider_patches": msg.ColliderPatchArray,
    "body_states": msg.TrackedBodyArray,
    "contacts": msg.ContactArray,
    "timing": msg.Timing,
}
_INPUTS = {
    "heightmap": msg.Heightmap,
    "heightmap_update": msg.HeightmapUpdate,
    "terrain_mesh": msg.TerrainMesh,
    "terrain_mesh_update": msg.TerrainMeshUpdate,
    "tracked_bodies": msg.TrackedBodyArray,
    "body_poses": PoseArray,
}
# Queue of responses that wait while the probe handles other messages; the default depth of ROS is 10.
_SERVICE_QOS = QoSProfile(depth=1000)
# Number of lines of a node's log in the report of a wait that was in vain.
LOG_LINES = 15


class Probe:
    """Publishes inputs of ``<namespace>/terrain_collider``, calls its services and records its outputs.

    ``received``: messages by full topic name. A context manager.
    """

    def __init__(self, namespace: str = "") -> None:
        self.namespace = "/" + namespace.strip("/") if namespace.strip("/") else ""
        self.collider = self.namespace + COLLIDER
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("probe", context=self.context)
        self.received: dict[str, list[Any]] = {}
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._services: dict[tuple[str, Any], Any] = {}
        self._processes: list[Process] = []
        self.publishers = {
            topic: self.node.create_publisher(kind, self.topic(topic), 10) for topic, kind in _INPUTS.items()
        }
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
        try_shutdown(context=self.context)

    def topic(self, name: str) -> str:
        """Return the full name of a topic or service below the collider's name; a name with a leading ``/`` is kept."""
        return name if name.startswith("/") else f"{self.collider}/{name}"

    def listen(self, topic: str, kind: Any, qos: Any = 100) -> list[Any]:
        """Subscribe to a topic; return the list to which its messages are appended."""
        name = self.topic(topic)
        if name not in self.received:
            self.received[name] = []
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
        timeout: float = START_TIMEOUT,
    ) -> Iterator[Process]:
        """Run an executable of a package in the probe's namespace for the length of the block; yield its `Process`.

        The block begins once the collider is connected to the probe, within ``timeout`` [s], which is long for busy
        machines; the wait fails at once if the process ends. With another executable the block begins at once.
        """
        if self.namespace:
            arguments = [*arguments, "--ros-args", "-r", f"__ns:={self.namespace}", "--"]
        with Process(name, parameters, arguments, package=package, environment=environment) as process:
            self._processes.append(process)
            try:
                if (package, name) == ("smartmesh_ros", "terrain_collider"):
                    self.received[DIAGNOSTICS].clear()  # of one that was killed, which stays connected for a while
                    self.wait_for(self.connected, timeout=timeout, watch=process)
                yield process
            finally:
                self._processes.remove(process)
                for messages in self.received.values():
                    messages.clear()

    def publisher(self, kind: Any, topic: str, qos: Any = 10) -> Any:
        """Return a publisher of messages ``kind`` on ``topic`` (below the collider's name, or a full name) once it has
        a subscriber, and is matched with the collider if the collider subscribes to the topic."""
        publisher = self.node.create_publisher(kind, self.topic(topic), qos)
        with self._naming("subscription of", topic, self.node.get_topic_names_and_types):
            self.wait_for(publisher.get_subscription_count)
        self.wait_for(lambda: self._is_matched([publisher]))
        return publisher

    def connected(self) -> bool:
        """Return True if the collider is matched with every publisher and subscription of the probe."""
        count = self.node.count_publishers
        publishers = list(self.publishers.values())
        return (
            all(publisher.get_subscription_count() for publisher in publishers)
            and all(count(self.topic(topic)) for topic in (*_OUTPUTS, DIAGNOSTICS))
            and bool(self.newest_diagnostics())
            and self._is_matched(publishers)
        )

    def _is_matched(self, publishers: Sequence[Any]) -> bool:
        """Return True if the collider's diagnostics count publishers on the topics of ``publishers`` that it subscribes
        to.

        A publisher that has matched a subscription is not enough: until the subscription has matched the publisher too,
        best-effort messages (the bodies' poses) are lost.
        """
        counts = self.newest_diagnostics().get("connections", {})
        return all(int(counts.get(f"publishers of {publisher.topic_name}", 1)) for publisher in publishers)

    def spin(self, seconds: float = 0.02) -> None:
        """Handle one message or response, waiting up to ``seconds`` for it."""
        self._executor.spin_once(timeout_sec=seconds)

    def wait_for(self, condition: Callable[[], Any], *, timeout: float = TIMEOUT, watch: Process | None = None) -> Any:
        """Spin until the condition holds; return its value. Raises `AssertionError` with a report after ``timeout``
        [s], or if the process ``watch`` ends.

        A condition that takes long, such as a picture of a page, is followed by as long a spin: with one message in
        between, messages would come faster than they are handled, and responses wait behind them.
        """
        asked = monotonic()
        end = asked + timeout
        while not (value := condition()):
            if watch is not None and watch.process.poll() is not None:
                raise AssertionError(f"the node ended with {watch.process.returncode}: {watch.output}")
            if (now := monotonic()) > end:
                raise AssertionError(f"waited {timeout:.0f} s in vain; {self._report()}")
            self.spin()
            while monotonic() - now < now - asked:
                self.spin()
            asked = monotonic()
        return value

    def _report(self) -> str:
        """Return hints to why a condition did not hold: messages received and refused, connections, and the nodes'
        logs."""
        counts = {topic: len(messages) for topic, messages in self.received.items()}
        inputs = self.newest_diagnostics().get("inputs", {})
        refused = [f"{key.removeprefix('refused, ')} {value}" for key, value in inputs.items() if key != "message"]
        lines = [f"received {counts}", f"refused: {', '.join(refused) or 'nothing'}"]
        lines.append("connected, as publishers -> subscriptions:")
        # A topic of the test without other endpoints is the likely cause.
        topics = {publisher.topic_name for publisher in self.node.publishers}.union(self.received)
        for topic in sorted(topics - {"/rosout", "/parameter_events"}):
            ends = self.node.get_publishers_info_by_topic(topic), self.node.get_subscriptions_info_by_topic(topic)
            names = (", ".join(sorted({info.node_name for info in infos})) or "nobody" for infos in ends)
            lines.append(f"  {topic}: {' -> '.join(names)}")
        for process in self._processes:
            state = "runs" if process.process.poll() is None else f"ended with {process.process.returncode}"
            lines.append(f"{process.name} {state}; its last lines:")
            lines += [f"  {line}" for line in process.output.splitlines()[-LOG_LINES:]]
        return "\n".join(lines)

    def latest(self, topic: str) -> Any:
        """Wait for the next message of an output (below the collider's name, or a full name), at first the last one of
        a latched topic; return it."""
        if (name := self.topic(topic)) not in self.received:
            with self._naming("publisher of", topic, self.node.get_topic_names_and_types):
                [info, *_] = self.wait_for(lambda: self.node.get_publishers_info_by_topic(name))
            self.listen(topic, class_of(info.topic_type), QoSProfile(depth=100, **BEST))
        messages = self.received[name]
        seen = len(messages)
        self.wait_for(lambda: len(messages) > seen)
        return messages[-1]

    def client(self, service: str, kind: Any) -> Any:
        """Return a client of a service (below the collider's name, or a full name) once the service is available."""
        key = self.topic(service), kind
        if key not in self._services:
            self._services[key] = self.node.create_client(kind, key[0], qos_profile=_SERVICE_QOS)
            # The executor must know the client before a response can come: rmw_fastrtps does not report one that comes
            # while the executor asks for reports. Tasks wait behind the news of the client.
            self.wait_for(self._executor.create_task(lambda: None).done)
        with self._naming(f"{type_of(kind)} service", service, self.node.get_service_names_and_types):
            self.wait_for(self._services[key].service_is_ready, watch=self._newest_collider)
        return self._services[key]

    @contextmanager
    def _naming(self, what: str, name: str, known: Callable[[], list[tuple[str, list[str]]]]) -> Iterator[None]:
        """Tell a wait in vain for a ``name`` that there is none, and which of the ``known`` ones may be meant."""
        try:
            yield
        except AssertionError as error:
            missing = self.topic(name)
            if what == "subscription of" and (there := self.node.get_subscriptions_info_by_topic(missing)):
                kind, qos = there[0].topic_type, there[0].qos_profile
                qos_words = f"{qos.reliability.name} and {qos.durability.name}"
                raise AssertionError(f"{missing} is subscribed as {kind}, {qos_words}; {error}") from None
            others = [full.removeprefix(f"{self.collider}/") for full, _ in known() if full != missing]
            raise AssertionError(f"there is no {what} {missing}{suggestion(name, others)}; {error}") from None

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        """Call a service (below the collider's name, or a full name); return its response. Raises `AssertionError` if
        the request has no field of a name or type, or if the newest collider of `running` ended."""
        future = self.client(service, kind).call_async(kind.Request(check_fields=True, **fields))
        self.wait_for(future.done, watch=self._newest_collider)
        return future.result()

    @property
    def _newest_collider(self) -> Process | None:
        """The newest collider in a block of `running`; None if there is none."""
        return next((one for one in reversed(self._processes) if one.name == "terrain_collider"), None)

    def publish_map(self, heights: ArrayLike, **options: Any) -> msg.Heightmap:
        """Publish a map of heights (rows, columns) [m] and return its message; options as of `heightmap_message`."""
        message = heightmap_message(heights, stamp=options.pop("stamp", self.now()), **options)
        self.publishers["heightmap"].publish(message)
        return message

    def publish_poses(self, positions: Sequence[Sequence[float]], frame_id: str = "") -> None:
        """Publish positions [m] of the bodies ``body_0``, ``body_1``, ..., in a frame, else in the terrain's."""
        message = PoseArray(poses=[pose_message(position) for position in positions])
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        self.publishers["body_poses"].publish(message)

    def publish_bodies(self, bodies: dict[str, Sequence[float]], radius: float = 0.0, frame_id: str = "") -> None:
        """Publish tracked bodies by name and position [m], in a frame, else in the terrain's."""
        tracked = [msg.TrackedBody(id=name, pose=pose_message(at), radius=float(radius)) for name, at in bodies.items()]
        message = msg.TrackedBodyArray(bodies=tracked)
        message.header.stamp, message.header.frame_id = self.now(), frame_id
        self.publishers["tracked_bodies"].publish(message)

    def now(self) -> Any:
        """Return the time of the probe's clock, as a stamp."""
        return self.node.get_clock().now().to_msg()

    def patches(self) -> dict[int, NDArray[np.float64]]:
        """Return the vertices (n, 3) [m] of the newest markers by marker id."""
        markers = self.latest("patches").markers
        return {marker.id: points_of(marker) for marker in markers if marker.action == Marker.ADD}

    def diagnostics(self, task: str) -> dict[str, str]:
        """Return the values of a task in the collider's next diagnostics by key, and the task's ``message``."""
        return self.diagnostics_by_task()[task]

    def diagnostics_by_task(self) -> dict[str, dict[str, str]]:
        """Return the values of all tasks, and their ``message``, from the collider's next diagnostics."""
        while not (tasks := self._tasks_of(self.latest(DIAGNOSTICS))):
            pass  # diagnostics of another node
        return tasks

    def newest_diagnostics(self) -> dict[str, dict[str, str]]:
        """Return the same from the collider's newest diagnostics so far; empty before the first."""
        return next(filter(None, map(self._tasks_of, reversed(self.received[DIAGNOSTICS]))), {})

    def _tasks_of(self, message: DiagnosticArray) -> dict[str, dict[str, str]]:
        """Return the values of the collider's tasks, and their ``message``; empty if they are of another node."""
        own = f"{self.collider.strip('/')}: "
        return {
            status.name.removeprefix(own): {pair.key: pair.value for pair in status.values}
            | {"message": status.message}
            for status in message.status
            if status.name.startswith(own)
        }
