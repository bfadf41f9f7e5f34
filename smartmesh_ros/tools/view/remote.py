"""The running node, as seen through its topics and services. All callbacks run in the thread of `spin`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import (
    ColliderPatchArray,
    Heightmap,
    HeightmapUpdate,
    TerrainMesh,
    TerrainMeshUpdate,
    Timing,
)

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.client.messages import read_patches
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.view import reading
from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.sight import Sight

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Incremental outputs need every message; of the others only the newest is shown.
NEWEST, ALL = QoSProfile(depth=1), QoSProfile(depth=10)
# Every region counts; 200 regions last for 3 s at 60 Hz.
REGIONS = QoSProfile(depth=200)
OUTPUTS: dict[str, tuple[Any, QoSProfile]] = {
    **{topic: (kind, NEWEST) for topic, kind in reading.KINDS.items()},
    "body_descriptions": (reading.KINDS["body_descriptions"], LATCHED),
    "odometry": (reading.KINDS["odometry"], ALL),
    "collider_patches": (ColliderPatchArray, ALL),
    "timing": (Timing, ALL),
}
# Outputs that are empty without robots.
ROBOT_OUTPUTS = {"joint_states", "odometry"}
# Period of checks of the QoS of maps' publishers [s].
QOS_CHECK_PERIOD = 1.0
# Size [bytes] above which whole maps are received only once in a period [s], because the transfer to one more process
# delays the machine, and so the node, by a tenth of a second and more. Regions are always received.
LARGE_MAP, LARGE_MAP_PERIOD = 16_000_000, 5.0
# Numbers of stored log lines and messages of ~/timing.
LOG_LINES, TIMINGS = 6, 600


class Remote:
    """A ``terrain_collider`` with the full name ``name`` in this DDS domain.

    ``ground``: its terrain. ``sight``: bodies, patches and contacts. ``timings``: messages of ~/timing with their
    arrival [s]. ``warnings``: of the diagnostics. ``log``: last warnings of the log. ``paused``: None = unknown.
    ``changed_parameters``: changed values by name, until the reader replaces the dictionary.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.node = Node("smartmesh_view", use_global_arguments=False)
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self.ground = Ground()
        self.sight = Sight()
        self.timings: deque[tuple[float, Any]] = deque(maxlen=TIMINGS)
        self.warnings: list[str] = []
        self.log: deque[str] = deque(maxlen=LOG_LINES)
        self.paused: bool | None = None
        self.changed_parameters: dict[str, Any] = {}
        self.parameters = AsyncParameterClient(self.node, name)
        self._services: dict[str, Any] = {}
        self._new: dict[str, deque[bytes]] = {}
        self._patches: dict[str, Patch] = {}
        self._outputs: dict[str, Any] = {}
        self._maps: dict[str, tuple[Any, tuple[bool, bool]]] = {}  # subscription, (latched, reliable)
        self._qos_check_due = 0.0
        self._no_maps_until = 0.0  # end of the pause in receiving whole maps [s]
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.node.create_subscription(Log, "/rosout", self._on_log, 50)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self._on_parameters, 100)

    def close(self) -> None:
        """Destroy the view's ROS node."""
        self._executor.shutdown()
        self.node.destroy_node()

    def spin(self, seconds: float) -> None:
        """Handle messages for this long."""
        self._match_publishers()
        if monotonic() < self._no_maps_until and "heightmap" in self._maps:
            self.node.destroy_subscription(self._maps.pop("heightmap")[0])
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def watch(self, topics: set[str]) -> None:
        """Subscribe to these of `OUTPUTS` and unsubscribe from all others, because the node builds only outputs with
        subscribers."""
        for topic in set(self._outputs) - topics:
            self.node.destroy_subscription(self._outputs.pop(topic))
            self._new.pop(topic, None)
        for topic in topics - set(self._outputs):
            self._outputs[topic] = self._listen(topic, *OUTPUTS[topic])

    @property
    def is_running(self) -> bool:
        """True if the node publishes its body states."""
        return bool(self.node.count_publishers(f"{self.name}/body_states"))

    def call(self, service: str, kind: Any, done: Callable[[str], None], **fields: Any) -> None:
        """Call a service of the node. ``done`` gets the reason of a refusal, or "" after success."""
        name = f"{self.name}/{service}"
        client = self._services.get(name) or self.node.create_client(kind, name)
        self._services[name] = client
        if not client.service_is_ready():
            done(f"there is no service {name}: is the node running?")
            return
        future = client.call_async(kind.Request(**fields))
        future.add_done_callback(lambda _: done("" if future.result().success else future.result().message))

    def apply_waiting(self) -> None:
        """Apply all received messages to ``ground`` and ``sight``."""
        self.ground.apply_waiting()
        sight = self.sight
        for topic in reading.KINDS:
            waiting = list(self._new.pop(topic, ()))
            # The newest message is complete, except that odometry has a message for each robot.
            count = max(sum(bool(known.urdf) for known in sight.appearances.values()), 1) if topic == "odometry" else 1
            for data in waiting[-count:]:
                reading.take(sight, topic, data)
        self._apply_patches()
        now = monotonic()
        for data in self._new.pop("timing", ()):
            self.timings.append((now, deserialize_message(data, Timing)))

    def _apply_patches(self) -> None:
        waiting = list(self._new.pop("collider_patches", ()))
        whole = [index for index, data in enumerate(waiting) if not reading.is_incremental(data)]
        for data in waiting[whole[-1] if whole else 0 :]:
            try:
                message = read_patches(data)
            except InputError:
                continue
            if not message.incremental:
                self._patches = {}
            for name in message.removed:
                self._patches.pop(name, None)
            self._patches.update((patch.name, patch) for patch in message.patches)
        if waiting:
            self.sight.patches = list(self._patches.values())

    def _listen(self, topic: str, kind: Any, qos: QoSProfile) -> Any:
        def keep(data: bytes) -> None:
            self._new.setdefault(topic, deque(maxlen=max(qos.depth, 100))).append(data)

        return self.node.create_subscription(kind, f"{self.name}/{topic}", keep, qos, raw=True)

    def _match_publishers(self) -> None:
        """Subscribe to maps with the QoS of their publishers, so that a latched map arrives after its publication."""
        now = monotonic()
        if now < self._qos_check_due:
            return
        self._qos_check_due = now + QOS_CHECK_PERIOD
        ground = self.ground
        if now >= self._no_maps_until:
            self._listen_to_maps("heightmap", Heightmap, self._on_map, NEWEST)
        self._listen_to_maps("heightmap_update", HeightmapUpdate, ground.take_region, REGIONS)
        self._listen_to_maps("terrain_mesh", TerrainMesh, ground.take_mesh, ALL)
        self._listen_to_maps("terrain_mesh_update", TerrainMeshUpdate, ground.take_mesh_update, REGIONS)

    def _on_map(self, data: bytes) -> None:
        self.ground.take_map(data)
        if len(data) > LARGE_MAP:
            self._no_maps_until = monotonic() + LARGE_MAP_PERIOD

    def _listen_to_maps(self, topic: str, kind: Any, take: Callable[[bytes], None], qos: QoSProfile) -> None:
        name = f"{self.name}/{topic}"
        peers = [info.qos_profile for info in self.node.get_publishers_info_by_topic(name)]
        latched = bool(peers) and all(peer.durability == DurabilityPolicy.TRANSIENT_LOCAL for peer in peers)
        reliable = all(peer.reliability == ReliabilityPolicy.RELIABLE for peer in peers)
        if topic in self._maps:
            if self._maps[topic][1] == (latched, reliable):
                return
            self.node.destroy_subscription(self._maps[topic][0])
        wanted = QoSProfile(
            depth=qos.depth,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        )
        subscription = self.node.create_subscription(kind, name, take, wanted, raw=True)
        self._maps[topic] = subscription, (latched, reliable)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        paused = reading.is_paused(message, self.name)
        if paused is not None:
            self.paused = paused
            self.warnings = reading.warnings_of(message, self.name)

    def _on_log(self, message: Log) -> None:
        if message.name == self.name.strip("/").replace("/", ".") and message.level >= Log.WARN:
            self.log.append(message.msg)

    def _on_parameters(self, event: ParameterEvent) -> None:
        if event.node == self.name:
            for parameter in (*event.new_parameters, *event.changed_parameters):
                self.changed_parameters[parameter.name] = rclpy.parameter.parameter_value_to_python(parameter.value)
