"""The node ``fleet_front``: one interface for several terrain_collider nodes on one terrain.

The front assigns each body of ~/spawn_body and ~/spawn_bodies to a node, and forwards ~/remove_body and ~/remove_bodies
to the body's node. When a node dies, the front respawns its bodies in their last known states. ~/timing covers all
nodes. The nodes themselves publish on one shared topic of patches.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from smartmesh_msgs.msg import BodySpecification, Timing, TrackedBodyArray
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.errors import InputError, counted, listed
from smartmesh_ros.node.fleet.calls import Calls, same_as, specification_of
from smartmesh_ros.node.fleet.layout import FRONT, marker_namespace, node_names
from smartmesh_ros.node.fleet.ledger import Duties, FleetBody, Ledger, LedgerConfig
from smartmesh_ros.node.fleet.peers import NEWEST_QOS, PeerReader, topic_of
from smartmesh_ros.node.inputs.conversions import require_once
from smartmesh_ros.node.outputs.diagnostics import task_status
from smartmesh_ros.node.parameters.declaring import ParameterNode, fixed
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.parameters.settings import full_names
from smartmesh_ros.node.refusals import GRACE, LOG_PERIOD, shortened
from smartmesh_ros.node.running import spin
from smartmesh_ros.node.services.body_services import failures_of, noting
from smartmesh_ros.node.session import OUTPUTS, SERVICES

_D = LedgerConfig()
SPECS = (
    fixed("nodes", node_names(2), "Full names of the nodes of the fleet."),
    fixed("spread", _D.spread, "Node of a new body: the node with the fewest bodies, or the node of its start tile.",
          choices=("fewest", "tiles")),
    fixed("tile_size", _D.tile_size, "Side of a tile [m].", 0.1, 1e6),
    fixed("timeout", _D.timeout, "Silence after which a node counts as dead [s].", 0.1, 3600.0),
    fixed("respawn", _D.respawn, "Where bodies of a dead node are respawned: elsewhere, or on the same node once it is "
          "back.", choices=("elsewhere", "same")),
)  # fmt: skip
# Period of the checks of the nodes, and of publishing diagnostics and timing [s].
CHECK_PERIOD, REPORT_PERIOD = 0.25, 1.0


class _Never(ReentrantCallbackGroup):
    """Callback group that an executor never runs."""

    def can_execute(self, entity: Any) -> bool:
        return False


class Polled:
    """The subscription to the states of a ``node``, of which DDS keeps only the newest message.

    Nodes publish their states in every step. An executor that wakes for each message spends more time on that than on
    reading the few that are needed. rclpy has no public way to take a message without an executor, so the subscription
    is kept from the executors by a callback group, and its handle takes messages as rclpy's executors do.
    """

    def __init__(self, front: Node, node: str) -> None:
        self._group = _Never()
        self._subscription = front.create_subscription(
            TrackedBodyArray, topic_of(node), lambda _: None, NEWEST_QOS, callback_group=self._group, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message as bytes; None if no message arrived since the last call."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(TrackedBodyArray, True)
        return None if taken is None else taken[0]


class Front(ParameterNode):
    """Assigns bodies to the nodes of a fleet and reports on all nodes."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(FRONT, SPECS, **node_options)
        values = self.values
        config = LedgerConfig(**{name: values[name] for name in ("spread", "tile_size", "timeout", "respawn")})
        if not values["nodes"]:
            right = f"give the full name of at least one node, such as {node_names(1)[0]}"
            raise InputError("parameter", f"nodes is []; {right}")
        self.ledger = Ledger(full_names("nodes", values["nodes"]), config)
        self._group = ReentrantCallbackGroup()
        self._calls = Calls(self, self.ledger.members, self._group)
        self._readers = {node: PeerReader() for node in self.ledger.members}
        self._states = {node: Polled(self, node) for node in self.ledger.members}
        self._timings: dict[str, Timing] = {}
        self._started_at = monotonic()  # [s]
        for node in self.ledger.members:
            take = partial(self._timings.__setitem__, marker_namespace(node).rpartition("/")[2])
            self.create_subscription(Timing, f"{node}/timing", take, 10)
        self._serve(SpawnBody, "spawn_body", self._spawn, lambda request: [same_as(request)])
        self._serve(SpawnBodies, "spawn_bodies", self._spawn, lambda request: request.bodies)
        self._serve(RemoveBody, "remove_body", self._remove, lambda request: [request.id])
        self._serve(RemoveBodies, "remove_bodies", self._remove, lambda request: request.ids)
        self._patches = self.create_publisher(MarkerArray, "~/patches", OUTPUTS)
        self._timing = self.create_publisher(Timing, "~/timing", OUTPUTS)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", OUTPUTS)
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
                self.ledger.update_states(node, self._readers[node].read(data).bodies)
            except InputError as error:
                self.get_logger().warning(f"{node}: {error}", throttle_duration_sec=LOG_PERIOD)
        duties = self.ledger.check(monotonic())
        self._log_changes(duties)
        self._calls.give_up(duties.died)
        for node in {entry.node for entry in duties.spawn}:
            await self._respawn(node, [entry for entry in duties.spawn if entry.node == node])
        for node, name in duties.remove:
            await self._calls.remove(node, [name])

    async def _respawn(self, node: str, lost: list[FleetBody]) -> None:
        """Respawn lost bodies on a node. If the node refuses some, try once more with the others."""
        bodies = {one.name: specification_of(one) for one in lost}
        if refused := await self._calls.spawn(node, list(bodies.values())):
            reason = next(iter(refused.values()))
            self.get_logger().warning(f"not spawned again yet: {reason}", throttle_duration_sec=LOG_PERIOD)
            bodies = {name: body for name, body in bodies.items() if name not in refused}
            if bodies and await self._calls.spawn(node, list(bodies.values())):
                bodies = {}
        for one in lost:
            self.ledger.answered(one.name, monotonic(), success=one.name in bodies)
        if bodies:
            self.get_logger().info(f"spawned again on {node}: {_counted(list(bodies))}")

    def _log_changes(self, duties: Duties) -> None:
        config, log = self.ledger.config, self.get_logger()
        for node in duties.joined:
            log.info(f"{node} joined the fleet")
        place = "elsewhere" if config.respawn == "elsewhere" else "when it is back"
        for node in duties.died:
            lost = duties.lost.get(node, [])
            bodies = f"to be spawned again {place}: {_counted(lost)}" if lost else "it had no bodies"
            log.error(f"{node} died: not heard for {config.timeout:g} s; {bodies}")
            # A dead node cannot delete its markers itself.
            gone = Marker(ns=marker_namespace(node), action=Marker.DELETEALL)
            self._patches.publish(MarkerArray(markers=[gone]))
        for node in duties.lost.keys() - set(duties.died):
            log.error(f"{node} restarted without its bodies; to be spawned again: {_counted(duties.lost[node])}")

    def _serve(self, kind: Any, name: str, act: Callable[[Any], Awaitable[dict[str, str]]], asked: Any) -> None:
        """Serve ``~/name`` by an act on what is ``asked`` of a request. The act returns reasons of refusals by body."""

        async def answer(request: Any, response: Any) -> Any:
            refused = await act(asked(request))
            response.success = not refused
            response.message = shortened(next(iter(refused.values()), ""))
            if refused and hasattr(response, "failures"):
                response.failures = failures_of(refused)
                nothing = ", so nothing was changed" if kind is SpawnBodies else ""
                response.message = f"{counted(len(refused))} refused{nothing}: {response.message}"
            return response

        self.create_service(kind, f"~/{name}", answer, callback_group=self._group, qos_profile=SERVICES)

    async def _spawn(self, bodies: Sequence[BodySpecification]) -> dict[str, str]:
        """Spawn all bodies, each on a node that the ledger chooses, or none."""
        chosen: dict[str, list[BodySpecification]] = {}
        refused: dict[str, str] = {}
        counts = Counter(body.id for body in bodies)
        for body in bodies:
            with noting(refused, body.id):
                require_once(body.id, counts)
                place = body.pose.position
                chosen.setdefault(self.ledger.choose(body.id, place.x, place.y, body), []).append(body)
        added = []
        for node, group in chosen.items():
            refused |= {} if refused else await self._calls.spawn(node, group)
            for body in group:
                self.ledger.answered(body.id, monotonic(), success=not refused)
            if not refused:
                added.append((node, [body.id for body in group]))
        for node, names in added if refused else ():
            await self._calls.remove(node, names)
            for name in names:
                self.ledger.bodies.pop(name, None)
        return refused

    async def _remove(self, names: Sequence[str]) -> dict[str, str]:
        """Remove bodies from their nodes, none if the fleet does not have all of them."""
        chosen: dict[str, list[str]] = {}
        refused: dict[str, str] = {}
        for name in names:
            with noting(refused, name):
                chosen.setdefault(self.ledger.node_of(name), []).append(name)
        for node, group in {} if refused else chosen.items():
            found = await self._calls.remove(node, group)
            for name in () if found else group:
                self.ledger.bodies.pop(name, None)
            refused |= found
        return refused

    def _report(self) -> None:
        """Publish the diagnostics, and the timing of all nodes since the last report."""
        if self._timings and self._timing.get_subscription_count():
            timing = merged_timing(self._timings)
            timing.header.stamp = self.get_clock().now().to_msg()
            self._timing.publish(timing)
        self._timings.clear()
        self.ledger.connected = {f"{space.rstrip('/')}/{name}" for name, space in self.get_node_names_and_namespaces()}
        living, waiting, starting = self.ledger.living, self.ledger.waiting, self.ledger.starting
        if not (living or starting) and monotonic() - self._started_at > GRACE:
            self.get_logger().warning(f"none of {', '.join(self.ledger.members)} is heard; start them", once=True)
        counts = Counter(entry.node for entry in self.ledger.bodies.values())
        dead = self.ledger.members.keys() - {*living, *starting}
        values: dict[str, Any] = {
            node: "not heard" if node in dead else "starting" if node in starting else counted(counts[node])
            for node in self.ledger.members
        }
        values |= {"bodies": len(self.ledger.bodies), "spawned again": self.ledger.respawned}
        values["waiting to be spawned again"] = len(waiting)
        level, text = DiagnosticStatus.OK, counted(len(living), "node", "nodes")
        if dead:
            level, text = DiagnosticStatus.ERROR, f"not heard: {', '.join(sorted(dead))}"
        elif starting:
            level, text = DiagnosticStatus.WARN, f"starting: {', '.join(sorted(starting))}"
        elif waiting:
            level, text = DiagnosticStatus.WARN, f"{counted(len(waiting))} to be spawned again"
        own = self.get_fully_qualified_name()
        message = DiagnosticArray(status=[task_status(own, "nodes", level, text, values)])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _counted(names: Sequence[str]) -> str:
    """Return the number of bodies and the first names."""
    return f"{counted(len(names))} ({listed(names)})"


def merged_timing(timings: Mapping[str, Timing]) -> Timing:
    """Return one message for timings by node name: the lowest real-time factor, the sum of the deadline misses, and
    every stage, which is renamed to ``node/stage``."""
    message = Timing()
    for name, timing in timings.items():
        message.window_s = max(message.window_s, timing.window_s)
        message.deadline_misses += timing.deadline_misses
        for stage in timing.stages:
            stage.stage = f"{name}/{stage.stage}"
            message.stages.append(stage)
    message.real_time_factor = min((timing.real_time_factor for timing in timings.values()), default=0.0)
    return message


def main(args: Sequence[str] | None = None) -> None:
    answer("fleet_front", __doc__, SPECS, args)
    spin(Front, args)
