"""Watches a fleet on its network, and has it do things."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, Timing, TrackedBodyArray
from smartmesh_msgs.srv import SpawnBodies

from smartmesh_ros.fleet_commands import FleetPlan
from smartmesh_ros.fleet_layout import front_of, node_names
from smartmesh_ros.studies.fleet.network import Machine

# Waits for anything [s]: a shared machine may be slow.
PATIENCE = 120.0
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Watcher(Node):
    """What the nodes of a fleet say. ``heard``: when each was heard last; ``timings``: since they were cleared."""

    def __init__(self, count: int) -> None:
        super().__init__("fleet_watcher")
        self.nodes = node_names(count)
        self.heard: dict[str, float] = {}
        self._states: dict[str, TrackedBodyArray] = {}
        self.timings: dict[str, list[Timing]] = {node: [] for node in self.nodes}
        self.front: dict[str, str] = {}
        for node in self.nodes:
            self.create_subscription(TrackedBodyArray, f"{node}/body_states", self._keeper(node), NEWEST, raw=True)
            self.create_subscription(Timing, f"{node}/timing", self.timings[node].append, 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)
        self._spawner = self.create_client(SpawnBodies, f"{front_of()}/spawn_bodies")

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        end = monotonic() + seconds
        while monotonic() < end:
            rclpy.spin_once(self, timeout_sec=max(end - monotonic(), 0.0))

    def wait_for(self, condition: Callable[[], Any], what: str) -> float:
        """Handles messages until the condition holds; the time it took [s]."""
        start = monotonic()
        while not condition():
            if monotonic() > start + PATIENCE:
                raise TimeoutError(f"no {what} after {PATIENCE:.0f} s; the front says {self.front}")
            rclpy.spin_once(self, timeout_sec=0.05)
        return monotonic() - start

    def complete(self) -> bool:
        """Whether the front hears all nodes."""
        return self.front.get("") == f"{len(self.nodes)} nodes"

    def owners(self) -> Counter[str]:
        """How many nodes that were heard within a second simulate each body."""
        now = monotonic()
        living = [node for node, time in self.heard.items() if now - time < 1.0]
        return Counter(body for node in living for body in self._bodies(node))

    def each_once(self, count: int) -> bool:
        """Whether there are so many bodies, each on one node."""
        owners = self.owners()
        return len(owners) == count and set(owners.values()) <= {1}

    def fullest(self) -> int:
        """The node with the most bodies."""
        return max(range(len(self.nodes)), key=lambda index: len(self._bodies(self.nodes[index])))

    def spawn(self, places: list[tuple[float, float]], first: int, height: float = 0.6) -> None:
        """Has the front spawn a ball at each place, numbered from ``first`` on."""
        request = SpawnBodies.Request()
        for number, (x, y) in enumerate(places, first):
            ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2])
            body = BodySpecification(id=f"ball_{number:05d}", shape=ball, mass=5.0)
            body.pose.position.x, body.pose.position.y, body.pose.position.z = x, y, height
            request.bodies.append(body)
        self.wait_for(self._spawner.service_is_ready, "front")
        future = self._spawner.call_async(request)
        self.wait_for(future.done, "answer of the front")
        if not future.result().success:
            raise RuntimeError(f"bodies were not spawned: {future.result().message}")

    def _bodies(self, node: str) -> list[str]:
        data = self._states.get(node)
        return [] if data is None else [body.id for body in deserialize_message(data, TrackedBodyArray).bodies]

    def _keeper(self, node: str) -> Callable[[Any], None]:
        def keep(data: Any) -> None:
            self._states[node], self.heard[node] = data, monotonic()

        return keep

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "fleet: nodes":
                self.front = {pair.key: pair.value for pair in status.values} | {"": status.message}


class Site:
    """A fleet on machines of its own: node i on ``machines[i]``, the source of terrain and the front on another."""

    def __init__(self, plan: FleetPlan, folder: Path) -> None:
        self._plan, self._folder = plan, folder
        self.machines = [Machine(index) for index in range(plan.count)]
        self._hub = [Machine(plan.count), Machine(plan.count + 1)]
        self.watcher = Watcher(plan.count)

    def start(self) -> None:
        """Starts everything and waits until the front hears all nodes."""
        self._hub[0].start(self._plan.source_command(self._folder), self._folder / "source.txt")
        self._hub[1].start(self._plan.front_command(self._folder), self._folder / "front.txt")
        for index in range(self._plan.count):
            self.start_node(index)
        self.watcher.wait_for(self.watcher.complete, "fleet")

    def start_node(self, index: int) -> None:
        """Starts a node, again if need be."""
        self.machines[index].start(self._plan.node(index, self._folder), self._folder / f"node_{index}.txt")

    def close(self) -> None:
        """Ends everything."""
        self.watcher.destroy_node()
        for machine in (*self.machines, *self._hub):
            machine.close()


@contextmanager
def site(plan: FleetPlan) -> Iterator[Site]:
    """A running fleet."""
    rclpy.init()
    with tempfile.TemporaryDirectory() as folder:
        made = Site(plan, Path(folder))
        try:
            made.start()
            yield made
        except BaseException:
            for log in sorted(Path(folder).glob("*.txt")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}", flush=True)
            raise
        finally:
            made.close()
            rclpy.try_shutdown()


def load() -> float:
    """Mean number of processes that wanted to run in the last minute, ours among them."""
    return os.getloadavg()[0]
