"""Observes a fleet on its network, and controls it."""

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
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import Timing, TrackedBodyArray

from smartmesh_ros.node.fleet.layout import node_names
from smartmesh_ros.node.fleet.plan import FleetPlan
from smartmesh_ros.node.fleet.watcher import FleetWatcher
from studies.fleet.network import Machine

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Watcher(FleetWatcher):
    """Subscriptions to the nodes of a fleet. ``heard``: time of each node's last message; ``timings``: messages since
    the list was cleared. ``with_bodies``: True = also their bodies, which costs as much as one more node."""

    def __init__(self, count: int, *, with_bodies: bool) -> None:
        super().__init__()
        self.nodes = node_names(count)
        self.heard: dict[str, float] = {}
        self._states: dict[str, TrackedBodyArray] = {}
        self.timings: dict[str, list[Timing]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            if with_bodies:
                self.create_subscription(TrackedBodyArray, f"{node}/body_states", self._keeper(node), NEWEST, raw=True)
            self.create_subscription(Timing, f"{node}/timing", self.timings[node].append, 10)

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        end = monotonic() + seconds
        while monotonic() < end:
            rclpy.spin_once(self, timeout_sec=max(end - monotonic(), 0.0))

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
        self.spawn_balls(((f"ball_{number:05d}", x, y, height) for number, (x, y) in enumerate(places, first)), 0.2)

    def _bodies(self, node: str) -> list[str]:
        data = self._states.get(node)
        return [] if data is None else [body.id for body in deserialize_message(data, TrackedBodyArray).bodies]

    def _keeper(self, node: str) -> Callable[[Any], None]:
        def keep(data: Any) -> None:
            self._states[node], self.heard[node] = data, monotonic()

        return keep


class Site:
    """A fleet on machines of its own: node i on ``machines[i]``, the source of terrain and the front on another."""

    def __init__(self, plan: FleetPlan, folder: Path, *, with_bodies: bool) -> None:
        self._plan, self._folder = plan, folder
        self.machines = [Machine(index) for index in range(plan.count)]
        self._hub = [Machine(plan.count), Machine(plan.count + 1)]
        self.watcher = Watcher(plan.count, with_bodies=with_bodies)

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
def site(plan: FleetPlan, *, with_bodies: bool = True) -> Iterator[Site]:
    """A running fleet, and whether its bodies are watched."""
    rclpy.init()
    with tempfile.TemporaryDirectory() as folder:
        made = Site(plan, Path(folder), with_bodies=with_bodies)
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
