"""The node ``fleet_front``: one interface for several terrain_collider nodes on one terrain.

The front assigns each body of ~/spawn_body and ~/spawn_bodies to a node, and forwards ~/remove_body and ~/remove_bodies
to the body's node. When a node dies, the front respawns its bodies in their last known states. ~/timing covers all
nodes. The nodes themselves publish on one shared topic of patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import BodyFailure, Timing, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.fleet import timing
from smartmesh_ros.node.fleet.calls import Calls
from smartmesh_ros.node.fleet.layout import FRONT, marker_namespace, node_names
from smartmesh_ros.node.fleet.ledger import Duties, Ledger, LedgerConfig, Respawning
from smartmesh_ros.node.fleet.peer_names import full_names
from smartmesh_ros.node.fleet.peer_states import PeerReader
from smartmesh_ros.node.fleet.polling import Polled
from smartmesh_ros.node.fleet.requests import place_of, specification_of
from smartmesh_ros.node.outputs.diagnostics import task_name
from smartmesh_ros.node.parameters.declaring import Spec, declare
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.parameters.parameter_node import ParameterNode
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.session import SERVICES

_D = LedgerConfig()
SPECS = (
    Spec("nodes", node_names(2), "Full names of the nodes of the fleet.", read_only=True),
    Spec("spread", _D.spread, "Node of a new body: the node with the fewest bodies, or the node of its start tile.",
         choices=("fewest", "tiles"), read_only=True),
    Spec("tile_size", _D.tile_size, "Side of a tile [m].", 0.1, 1e6, read_only=True),
    Spec("timeout", _D.timeout, "Silence after which a node counts as dead [s].", 0.1, 3600.0, read_only=True),
    Spec("respawn", _D.respawn, "Where bodies of a dead node are respawned: elsewhere, or on the same node once it is "
         "back.", choices=("elsewhere", "same"), read_only=True),
)  # fmt: skip
# Period of the checks of the nodes, and of publishing diagnostics and timing [s].
CHECK_PERIOD, REPORT_PERIOD = 0.25, 1.0
# Upper bounds of bodies in a node's message and of characters in a name. The nodes have narrower bounds.
MAX_BODIES, MAX_NAME = 1_000_000, 65_535
# Maximum number of body names in a log line.
MOST_NAMED = 10


class Front(ParameterNode):
    """Assigns bodies to the nodes of a fleet and reports on all nodes."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(FRONT, SPECS, **node_options)
        values = declare(self, SPECS)
        config = LedgerConfig(**{name: values[name] for name in ("spread", "tile_size", "timeout", "respawn")})
        self.ledger = Ledger(full_names("nodes", values["nodes"]), config)
        self._group = ReentrantCallbackGroup()
        self._calls = Calls(self, self.ledger.members, self._group)
        self._readers = {node: PeerReader() for node in self.ledger.members}
        self._states = {node: Polled(self, TrackedBodyArray, f"{node}/body_states") for node in self.ledger.members}
        self._timings: dict[str, Timing] = {}
        self._listening: list[Any] = []
        for kind, name, act in (
            (SpawnBody, "spawn_body", self._on_spawn),
            (SpawnBodies, "spawn_bodies", self._on_spawn_all),
            (RemoveBody, "remove_body", self._on_remove),
            (RemoveBodies, "remove_bodies", self._on_remove_all),
        ):
            self.create_service(kind, f"~/{name}", act, callback_group=self._group, qos_profile=SERVICES)
        self._patches = self.create_publisher(MarkerArray, "~/patches", QoSProfile(depth=10))
        self._timing = self.create_publisher(Timing, "~/timing", QoSProfile(depth=10))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        self.create_timer(CHECK_PERIOD, self._check_nodes, callback_group=self._group)
        self.create_timer(REPORT_PERIOD, self._report, callback_group=self._group)

    async def _check_nodes(self) -> None:
        """Check the nodes: respawn the bodies of dead nodes, and remove duplicate bodies."""
        for node, states in self._states.items():
            data = states.take()
            if data is None:
                continue
            self.ledger.hear(node, monotonic())
            try:
                self.ledger.update_states(node, self._readers[node].read(data, MAX_BODIES, MAX_NAME).bodies)
            except InputError as error:
                self.get_logger().warning(f"{node}: {error}", throttle_duration_sec=5.0)
        duties = self.ledger.check(monotonic())
        self._log_changes(duties)
        for node in duties.died:
            self._calls.give_up(node)
        for target in {respawning.node for respawning in duties.spawn}:
            await self._respawn(target, [again for again in duties.spawn if again.node == target])
        for node, name in duties.remove:
            await self._calls.remove(node, name)

    async def _respawn(self, node: str, lost: list[Respawning]) -> None:
        """Respawn lost bodies on a node. If the node refuses some, try once more with the others."""
        refused: set[str] = set()
        success = False
        for _ in range(2):
            bodies = [specification_of(one) for one in lost if one.name not in refused]
            response = await self._calls.spawn_all(node, bodies)
            success = response.success
            if success or not response.failures:
                break
            refused |= {failure.id for failure in response.failures}
            self.get_logger().warning(f"not spawned again yet: {response.message}", throttle_duration_sec=5.0)
        for one in lost:
            self._record(success and one.name not in refused, one.name)
        if again := [one.name for one in lost if success and one.name not in refused]:
            self.get_logger().info(f"spawned again on {node}: {_listed(again)}")

    def _log_changes(self, duties: Duties) -> None:
        for node in duties.joined:
            self.get_logger().info(f"{node} joined the fleet")
        for node in duties.died:
            lost = duties.lost.get(node, [])
            bodies = f"to be spawned again {self._respawn_place()}: {_listed(lost)}" if lost else "it had no bodies"
            self.get_logger().error(f"{node} died: not heard for {self.ledger.config.timeout:g} s; {bodies}")
            # A dead node cannot delete its markers itself.
            gone = Marker(ns=marker_namespace(node), action=Marker.DELETEALL)
            self._patches.publish(MarkerArray(markers=[gone]))

        for node in duties.lost.keys() - set(duties.died):
            bodies = _listed(duties.lost[node])
            self.get_logger().error(f"{node} restarted without its bodies; to be spawned again: {bodies}")

    def _respawn_place(self) -> str:
        return "elsewhere" if self.ledger.config.respawn == "elsewhere" else "when it is back"

    async def _on_spawn(self, request: Any, response: Any) -> Any:
        try:
            node = self.ledger.choose(request.id, *place_of(request), request)
        except InputError as error:
            response.message = str(error)
            return response
        answered = await self._calls.spawn(node, request)
        self._record(answered.success, request.id)
        return answered

    async def _on_spawn_all(self, request: Any, response: Any) -> Any:
        chosen: dict[str, list[Any]] = {}
        failures = []
        for body in request.bodies:
            try:
                chosen.setdefault(self.ledger.choose(body.id, *place_of(body), body), []).append(body)
            except InputError as error:
                failures.append(BodyFailure(id=body.id, reason=str(error)))
        added: list[tuple[str, str]] = []
        for node, bodies in chosen.items():
            answered = None if failures else await self._calls.spawn_all(node, bodies)
            success = answered is not None and answered.success
            if answered is not None:
                failures += answered.failures
                if not success and not answered.failures:
                    failures += [BodyFailure(id=body.id, reason=answered.message) for body in bodies]
            for body in bodies:
                self._record(success, body.id)
                if success:
                    added.append((node, body.id))
        if failures:  # all or none
            for node, name in added:
                await self._calls.remove(node, name)
                self.ledger.removed(name)
        response.success, response.failures = not failures, failures
        if failures:
            response.message = f"{len(failures)} bodies are refused, so nothing was changed: {failures[0].reason}"
        return response

    async def _on_remove(self, request: Any, response: Any) -> Any:
        try:
            node = self.ledger.node_of(request.id)
        except InputError as error:
            response.message = str(error)
            return response
        answered = await self._calls.remove(node, request.id)
        if answered.success:
            self.ledger.removed(request.id)
        return answered

    async def _on_remove_all(self, request: Any, response: Any) -> Any:
        chosen: dict[str, list[str]] = {}
        for name in request.ids:
            try:
                chosen.setdefault(self.ledger.node_of(name), []).append(name)
            except InputError as error:
                response.failures.append(BodyFailure(id=name, reason=str(error)))
        for node, names in {} if response.failures else chosen.items():
            answered = await self._calls.remove_all(node, names)
            response.failures += answered.failures
            for name in names if answered.success else ():
                self.ledger.removed(name)
        response.success = not response.failures
        if response.failures:
            response.message = f"{len(response.failures)} bodies are refused: {response.failures[0].reason}"
        return response

    def _record(self, success: bool, name: str) -> None:
        if success:
            self.ledger.spawned(name, monotonic())
        else:
            self.ledger.not_spawned(name)

    def _report(self) -> None:
        self._publish_timing()
        self.ledger.set_connected(f"{space.rstrip('/')}/{name}" for name, space in self.get_node_names_and_namespaces())
        counts: dict[str, int] = dict.fromkeys(self.ledger.members, 0)
        for entry in self.ledger.bodies.values():
            counts[entry.node] += 1
        living, waiting = self.ledger.living, self.ledger.waiting
        starting = self.ledger.starting
        absent = {node: "starting" if node in starting else "not heard" for node in counts}
        values = {node: f"{count} bodies" if node in living else absent[node] for node, count in counts.items()}
        values |= {"bodies": str(len(self.ledger.bodies)), "spawned again": str(self.ledger.respawned)}
        values["waiting to be spawned again"] = str(len(waiting))
        dead = [node for node in counts if node not in living and node not in starting]
        level, text = DiagnosticStatus.OK, f"{len(living)} nodes"
        if dead:
            level, text = DiagnosticStatus.ERROR, f"not heard: {', '.join(dead)}"
        elif starting:
            level, text = DiagnosticStatus.WARN, f"starting: {', '.join(sorted(starting))}"
        elif waiting:
            level, text = DiagnosticStatus.WARN, f"{len(waiting)} bodies wait to be spawned again"
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        own = self.get_fully_qualified_name()
        name = task_name(own, "nodes")
        status = DiagnosticStatus(level=level, name=name, message=text, hardware_id=own, values=pairs)
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _publish_timing(self) -> None:
        """Publish the timing of all nodes. Subscribe to the nodes' timing only while ~/timing has subscribers."""
        if not self._timing.get_subscription_count():
            for subscription in self._listening:
                self.destroy_subscription(subscription)
            self._listening.clear()
            self._timings.clear()
            return
        if not self._listening:
            for node in self.ledger.members:
                take = partial(self._timings.__setitem__, marker_namespace(node).rpartition("/")[2])
                self._listening.append(self.create_subscription(Timing, f"{node}/timing", take, 10))
        if self._timings:
            message = timing.merge(self._timings)
            message.header.stamp = self.get_clock().now().to_msg()
            self._timing.publish(message)
            self._timings.clear()


def _listed(names: Sequence[str]) -> str:
    """Return the number of bodies and the first `MOST_NAMED` names."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{len(names)} bodies ({', '.join(names[:MOST_NAMED])}{more})"


def main(args: Sequence[str] | None = None) -> None:
    """Run the front until SIGINT or SIGTERM."""
    answer("fleet_front", __doc__, SPECS, None if args is None else list(args))
    spin(Front, args)
