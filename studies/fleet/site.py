"""A fleet on machines of its own, and what is heard of it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import rclpy
from smartmesh_msgs.msg import Timing

from smartmesh_ros.node.fleet.command import FleetWatcher
from smartmesh_ros.node.fleet.layout import FleetPlan, node_names
from studies.fleet.network import Machine


class Watcher(FleetWatcher):
    """Subscriptions to the nodes of a fleet. ``timings``: of each node since its list was cleared."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.nodes = node_names(count)
        self.timings: dict[str, list[Timing]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            self.create_subscription(Timing, f"{node}/timing", self.timings[node].append, 10)

    def spin(self, seconds: float) -> None:
        """Handles messages for so long."""
        end = monotonic() + seconds
        while monotonic() < end:
            rclpy.spin_once(self, timeout_sec=max(end - monotonic(), 0.0))

    def complete(self) -> bool:
        """Whether the front hears all nodes."""
        return self.front.get("") == f"{len(self.nodes)} nodes"

    def spawn(self, places: list[tuple[float, float]], first: int, height: float = 0.6) -> None:
        """Has the front spawn a ball at each place, numbered from ``first`` on."""
        self.spawn_balls(((f"ball_{number:05d}", x, y, height) for number, (x, y) in enumerate(places, first)), 0.2)


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
            self.machines[index].start(self._plan.node(index, self._folder), self._folder / f"node_{index}.txt")
        self.watcher.wait_for(self.watcher.complete, "fleet")

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
