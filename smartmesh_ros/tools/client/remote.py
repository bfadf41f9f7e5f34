"""The running node, as seen through its topics and services. All callbacks run in the thread of `spin`."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from functools import partial
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.exceptions import InvalidTopicNameException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.utilities import try_shutdown
from rclpy.validate_full_topic_name import validate_full_topic_name
from smartmesh_msgs.msg import ColliderPatchArray, Timing
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies, SpawnBody, StepPhysics
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.running import Stop, init
from smartmesh_ros.node.transport import STATES, colliders, publishers_on
from smartmesh_ros.startup.dds import use_large_message_profile
from smartmesh_ros.tools.client.ground import MAPS, Ground
from smartmesh_ros.tools.client.patch import PatchesMessage, read_patches
from smartmesh_ros.tools.client.sight import KINDS, Sight, drawn_scene
from smartmesh_ros.tools.messages import BEST, DEPTH

# Types of the shown outputs. Outputs without subscribers are not built by the node.
OUTPUTS: dict[str, Any] = {
    **KINDS, "collider_patches": ColliderPatchArray, "scene": MarkerArray, "timing": Timing,
}  # fmt: skip
SERVICES = {
    "pause": SetBool, "step": StepPhysics, "reset": Trigger, "spawn_body": SpawnBody,
    "spawn_bodies": SpawnBodies, "remove_bodies": RemoveBodies,
}  # fmt: skip
# Topics of which only the newest message is shown; of the others every region and tile counts.
NEWEST = KINDS.keys() - {"odometry"}
# Longest wait for a node, which may be starting [s].
PATIENCE = 60.0
# Period of checks for publishers [s].
CHECK_PERIOD = 1.0
# Size [bytes] above which whole maps are received only once in a period [s], because the transfer to one more process
# delays the machine, and so the node, by a tenth of a second and more. Regions are always received.
LARGE_MAP, LARGE_MAP_PERIOD = 16_000_000, 5.0
# Prefix of the keys of diagnostics that count refusals.
REFUSED = "refused, "
# Numbers of stored log lines and messages of ~/timing.
LOG_LINES, TIMINGS = 6, 600


@contextmanager
def following(
    node: str, command: str, arguments: Sequence[str], patience: float = PATIENCE, *, interrupted: int = 0
) -> Iterator[tuple[Remote, Stop]]:
    """Follow a node (full name) for the length of the block, in a process of its own. An `InputError` ends the process
    with the name of the ``command`` and the reason, the first signal without a word and with ``interrupted``."""
    use_large_message_profile()
    init(arguments)
    stop = Stop()
    try:
        with closing(Remote("/" + node.strip("/"), patience)) as remote:
            yield remote, stop
    except InputError as error:
        sys.exit(f"{command}: {error}")
    except KeyboardInterrupt:
        sys.exit(interrupted)
    finally:
        try_shutdown()


class Remote:
    """A ``terrain_collider`` with the full name ``name`` in this DDS domain.

    ``runs``: a name of each run of the node that is discovered: a killed one stays for a while beside the next.
    ``ground``: its terrain. ``sight``: bodies, patches and contacts. ``timings``: messages of ~/timing with their
    arrival [s]. ``tasks``: the newest diagnostics, and ``warnings`` of these. ``log``: last warnings of the log.
    ``paused``: None = unknown. ``clients``: of `SERVICES`. ``changed_parameters``: changed values by name, until the
    reader replaces the dictionary.
    """

    def __init__(self, name: str, patience: float = PATIENCE) -> None:
        """``patience`` [s]: longest wait. Raises `InputError` if ``name`` cannot be that of a node."""
        try:
            validate_full_topic_name(f"{name}/{STATES}")
        except InvalidTopicNameException:
            words = "is no full name of a node, such as /robot/terrain_collider; names have letters, digits and _ alone"
            raise InputError("arguments", f"{name!r} {words}") from None
        self.name, self._patience = name, patience
        self.node = Node("smartmesh_view", use_global_arguments=False)
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self.timings: deque[tuple[float, Any]] = deque(maxlen=TIMINGS)
        self.log: deque[str] = deque(maxlen=LOG_LINES)
        self.changed_parameters: dict[str, Any] = {}
        self.parameters = AsyncParameterClient(self.node, name)
        self.clients = {key: self.node.create_client(kind, f"{name}/{key}") for key, kind in SERVICES.items()}
        self._new: dict[str, deque[bytes]] = {}
        self._watched: set[str] | None = None
        self._subscriptions: dict[str, tuple[Any, int]] = {}  # with the numbers of publishers
        self._no_maps_until = 0.0  # end of the pause in receiving whole maps [s]
        self._large_stamp = b""  # bytes of the stamp of the last large map
        self.runs: frozenset[bytes] = frozenset()
        self._forget()
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.node.create_subscription(Log, "/rosout", self._on_log, 50)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self._on_parameters, 100)

    def close(self) -> None:
        """Destroy the view's ROS node."""
        self._executor.shutdown()
        self.node.destroy_node()

    def spin(self, seconds: float) -> None:
        """Handle messages for this long."""
        before, self.runs = self.runs, publishers_on(self.node, f"{self.name}/{STATES}")
        if before and (self.runs - before or not self.runs):
            self._forget()
        if self._watched is not None and monotonic() >= self._check_due:
            self._subscribe(self._watched)
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def watch(self, topics: set[str]) -> None:
        """Subscribe to maps, which nobody receives before, and to these of `OUTPUTS` and no others, because the node
        builds only outputs with subscribers; to ``scene`` while no map has come, or poses of tracked bodies come on no
        other topic."""
        if topics != self._watched:
            self._watched, self._check_due = topics, 0.0

    @property
    def missing(self) -> str:
        """That no collider has this name, and which ones there are; empty if one has."""
        if self.runs:
            return ""
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        there = ", ".join(colliders(self.node)) or "none"
        return f"no terrain_collider is named {self.name} in DDS domain {domain} (ROS_DOMAIN_ID); running: {there}"

    def wait_for(self, condition: Callable[[], Any], what: str) -> Any:
        """Return a condition's value once it is true. Raises `InputError` after the remote's ``patience``."""
        end = monotonic() + self._patience
        while not (found := condition()):
            if monotonic() > end:
                words, missing = f"no {what} after {self._patience:g} s", self.missing
                raise InputError("timeout", f"{words}; {missing}" if missing else words)
            self.spin(0.02)
        return found

    def call(self, service: str, **fields: Any) -> str:
        """Call one of `SERVICES`; return what the node says on success. Raises `InputError` if the call is refused, or
        not answered."""
        client = self.clients[service]
        self.wait_for(client.service_is_ready, f"service {client.srv_name}")
        future = client.call_async(client.srv_type.Request(**fields))
        self.wait_for(future.done, f"answer of {client.srv_name}")
        if not future.result().success:
            raise InputError("refused", future.result().message)
        return str(future.result().message)

    def apply_waiting(self) -> None:
        """Apply all received messages to ``ground`` and ``sight``. Malformed ones are skipped, because the node reports
        them."""
        self.ground.apply_waiting()
        for topic in KINDS:
            for data in self._new.pop(topic, ()):
                with suppress(InputError):
                    self.sight.take(topic, data)
        for data in self._new.pop("scene", ()):
            with suppress(InputError):
                corners, tracked = drawn_scene(data)
                self.sight.take_tracked(tracked)
                if corners is not None:
                    self.ground.draw(corners)
        changes: list[PatchesMessage] = []
        for data in reversed(self._new.pop("collider_patches", ())):
            with suppress(InputError):
                changes.append(read_patches(data))
                if not changes[-1].incremental:
                    break
        for message in reversed(changes):
            self.sight.patches = message.onto(self.sight.patches)
        for data in self._new.pop("timing", ()):
            self.timings.append((monotonic(), deserialize_message(data, Timing)))

    def _forget(self) -> None:
        """Forget terrain, bodies and diagnostics of a run that has ended, and subscribe anew, so that latched messages
        come again."""
        for subscription, _ in self._subscriptions.values():
            self.node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._new.clear()
        self.ground, self.sight = Ground(), Sight()
        self.ground.frames = self.sight.bases
        self.tasks: dict[str, DiagnosticStatus] = {}
        self.warnings: list[str] = []
        self.paused: bool | None = None
        self._check_due = 0.0

    def _subscribe(self, watched: set[str]) -> None:
        """Subscribe to maps and watched outputs that have publishers, with the best QoS that these offer, so that a
        latched message arrives after its publication; unsubscribe from all others."""
        now = monotonic()
        self._check_due = now + CHECK_PERIOD
        wanted = MAPS.keys() - ({"heightmap"} if now < self._no_maps_until else set())
        needs_scene = not self.ground.tiles or self.sight.has_unheard
        wanted |= watched - (set() if needs_scene else {"scene"})
        counts = {topic: self.node.count_publishers(f"{self.name}/{topic}") for topic in wanted}
        for topic, (subscription, count) in list(self._subscriptions.items()):
            if counts.get(topic) != count:
                self.node.destroy_subscription(subscription)
                del self._subscriptions[topic]
                self._new.pop(topic, None)
        for topic in wanted - self._subscriptions.keys():
            if counts[topic]:
                kind, take = MAPS[topic][0] if topic in MAPS else OUTPUTS[topic], partial(self._take, topic)
                qos = QoSProfile(depth=1 if topic in NEWEST else DEPTH, **BEST)
                made = self.node.create_subscription(kind, f"{self.name}/{topic}", take, qos, raw=True)
                self._subscriptions[topic] = made, counts[topic]

    def _take(self, topic: str, data: bytes) -> None:
        if topic not in MAPS:
            self._new.setdefault(topic, deque(maxlen=1 if topic in NEWEST else DEPTH)).append(data)
            return
        self.ground.take(topic, data)
        if topic == "heightmap" and len(data) > LARGE_MAP:
            stamp, before = data[4:12], self._large_stamp  # behind the four bytes that say how CDR is written
            # A latched map comes again with each subscription. Maps without a stamp cannot be told apart.
            if stamp != before or not any(stamp):
                self._no_maps_until, self._check_due = monotonic() + LARGE_MAP_PERIOD, 0.0
            self._large_stamp = stamp

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        own = f"{self.name.strip('/')}: "
        tasks = {status.name.removeprefix(own): status for status in message.status if status.name.startswith(own)}
        if not tasks:
            return  # another node's
        self.tasks = tasks
        if "physics" in tasks:  # not of a fleet's front
            self.paused = any(pair.key == "paused" and pair.value == "True" for pair in tasks["physics"].values)
        self.warnings = []
        for task, status in tasks.items():
            if status.level != DiagnosticStatus.OK:
                self.warnings.append(f"{task}: {status.message}")
            for pair in status.values:
                if pair.key.startswith(REFUSED):
                    self.warnings.append(f"{pair.value} x {pair.key.removeprefix(REFUSED).replace('_', ' ')}")

    def _on_log(self, message: Log) -> None:
        if message.name == self.name.strip("/").replace("/", ".") and message.level >= Log.WARN:
            self.log.append(message.msg)

    def _on_parameters(self, event: ParameterEvent) -> None:
        if event.node == self.name:
            for parameter in (*event.new_parameters, *event.changed_parameters):
                self.changed_parameters[parameter.name] = parameter_value_to_python(parameter.value)
