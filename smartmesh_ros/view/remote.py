"""The running node, as its topics and services show it. Everything here happens in one thread, that of `spin`."""

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

from smartmesh_ros.client.messages import read_patches
from smartmesh_ros.client.patch import Patch
from smartmesh_ros.errors import InputError
from smartmesh_ros.view import reading
from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.sight import Sight

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Of increments none may be missing; of the others the newest counts.
NEWEST, ALL = QoSProfile(depth=1), QoSProfile(depth=10)
# Regions that may wait: each counts, for seconds at 60 Hz.
REGIONS = QoSProfile(depth=200)
OUTPUTS: dict[str, tuple[Any, QoSProfile]] = {
    **{topic: (kind, NEWEST) for topic, kind in reading.KINDS.items()},
    "body_descriptions": (reading.KINDS["body_descriptions"], LATCHED),
    "odometry": (reading.KINDS["odometry"], ALL),
    "collider_patches": (ColliderPatchArray, ALL),
    "timing": (Timing, ALL),
}
# Of these only robots have something to tell.
OF_ROBOTS = {"joint_states", "odometry"}
# So often it is looked whether publishers of maps want another quality of service [s].
LOOK_PERIOD = 1.0
# Whole maps of more bytes are taken so seldom [s]: to hand them to one more process takes the machine, and so the node,
# a tenth of a second and more. Regions of them are shown as they come.
LARGE, REST = 16_000_000, 5.0
# Lines of the node's log, and messages of ~/timing, that are kept.
LOG_LINES, TIMINGS = 6, 600


class Remote:
    """A ``terrain_collider`` of the whole name ``name``, somewhere in this DDS domain.

    ``ground``: its terrain. ``sight``: what moves. ``timings``: messages of ~/timing with the time they came at [s].
    ``troubles``, ``log``: what it warns of. ``paused``: whether its physics stands still, None before it said so.
    ``changed_parameters``: values that it told of since they were last taken, by name.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.node = Node("smartmesh_view", use_global_arguments=False)
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self.ground = Ground()
        self.sight = Sight()
        self.timings: deque[tuple[float, Any]] = deque(maxlen=TIMINGS)
        self.troubles: list[str] = []
        self.log: deque[str] = deque(maxlen=LOG_LINES)
        self.paused: bool | None = None
        self.changed_parameters: dict[str, Any] = {}
        self.parameters = AsyncParameterClient(self.node, name)
        self._services: dict[str, Any] = {}
        self._new: dict[str, deque[bytes]] = {}
        self._patches: dict[str, Patch] = {}
        self._outputs: dict[str, Any] = {}
        self._maps: dict[str, tuple[Any, tuple[bool, bool]]] = {}  # subscriptions, latched or not, reliable or not
        self._look_due = 0.0
        self._rest_until = 0.0  # no whole maps until then
        self._base = name.rpartition("/")[2]
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.node.create_subscription(Log, "/rosout", self._on_log, 50)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self._on_parameters, 100)

    def close(self) -> None:
        """Ends the view's node."""
        self._executor.shutdown()
        self.node.destroy_node()

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        self._look()
        if monotonic() < self._rest_until and "heightmap" in self._maps:
            self.node.destroy_subscription(self._maps.pop("heightmap")[0])
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def watch(self, topics: set[str]) -> None:
        """Listens to these of `OUTPUTS` and no others: what nobody listens to costs the node nothing."""
        for topic in set(self._outputs) - topics:
            self.node.destroy_subscription(self._outputs.pop(topic))
            self._new.pop(topic, None)
        for topic in topics - set(self._outputs):
            self._outputs[topic] = self._listen(topic, *OUTPUTS[topic])

    @property
    def there(self) -> bool:
        """Whether the node is running."""
        return bool(self.node.count_publishers(f"{self.name}/body_states"))

    def call(self, service: str, kind: Any, done: Callable[[str], None], **fields: Any) -> None:
        """Calls a service of the node; ``done`` gets what was refused, or "" when it was done."""
        name = f"{self.name}/{service}"
        client = self._services.get(name) or self.node.create_client(kind, name)
        self._services[name] = client
        if not client.service_is_ready():
            done(f"there is no service {name}: is the node running?")
            return
        future = client.call_async(kind.Request(**fields))
        future.add_done_callback(lambda _: done("" if future.result().success else future.result().message))

    def settle(self) -> None:
        """Brings ``ground`` and ``sight`` up to what has come."""
        self.ground.settle()
        sight = self.sight
        for topic in reading.KINDS:
            waiting = list(self._new.pop(topic, ()))
            # One message tells all there is, but of robots, each of which has messages of its own.
            count = max(sum(bool(known.urdf) for known in sight.appearances.values()), 1) if topic == "odometry" else 1
            for data in waiting[-count:]:
                reading.take(sight, topic, data)
        self._settle_patches()
        now = monotonic()
        for data in self._new.pop("timing", ()):
            self.timings.append((now, deserialize_message(data, Timing)))

    def _settle_patches(self) -> None:
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

    def _look(self) -> None:
        """Listens to maps as their publishers publish them: latched ones give the last map to whoever comes later."""
        now = monotonic()
        if now < self._look_due:
            return
        self._look_due = now + LOOK_PERIOD
        ground = self.ground
        if now >= self._rest_until:
            self._listen_to_maps("heightmap", Heightmap, self._on_map, NEWEST)
        self._listen_to_maps("heightmap_update", HeightmapUpdate, ground.take_region, REGIONS)
        self._listen_to_maps("terrain_mesh", TerrainMesh, ground.take_mesh, ALL)
        self._listen_to_maps("terrain_mesh_update", TerrainMeshUpdate, ground.take_mesh_update, REGIONS)

    def _on_map(self, data: bytes) -> None:
        self.ground.take_map(data)
        if len(data) > LARGE:
            self._rest_until = monotonic() + REST

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
        paused = reading.is_paused(message, self._base)
        if paused is not None:
            self.paused = paused
            self.troubles = reading.troubles_of(message, self._base)

    def _on_log(self, message: Log) -> None:
        if message.name == self.name.strip("/").replace("/", ".") and message.level >= Log.WARN:
            self.log.append(message.msg)

    def _on_parameters(self, event: ParameterEvent) -> None:
        if event.node == self.name:
            for parameter in (*event.new_parameters, *event.changed_parameters):
                self.changed_parameters[parameter.name] = rclpy.parameter.parameter_value_to_python(parameter.value)
