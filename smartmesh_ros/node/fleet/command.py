"""``smartmesh-fleet``: several nodes on one moving terrain, their front, and bodies, without a ROS installation.

A node that dies is started again. Ends with Ctrl-C, or after --seconds.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, Timing
from smartmesh_msgs.srv import SpawnBodies

from smartmesh_ros.domains import isolated_unless_chosen
from smartmesh_ros.fleet_commands import FleetPlan
from smartmesh_ros.fleet_layout import front_of
from smartmesh_ros.node.dds import use_large_message_profile

# The scene: waves that bodies ride on, on maps as a lidar brings them.
SOURCE = {"scene": "waves", "rate": 20.0, "wave.amplitude": 0.1, "wave.number": 0.5, "wave.frequency": 2.0}
# Bodies start in rows so far apart, so high [m].
APART, HIGH = 0.9, 0.8
# Until everybody is there [s].
START_LIMIT = 120.0


class Watcher(Node):
    """Spawns bodies and says how the fleet is."""

    def __init__(self) -> None:
        super().__init__("fleet_watcher")
        self.values: dict[str, str] = {}
        self.factor = 0.0
        self._spawner = self.create_client(SpawnBodies, f"{front_of()}/spawn_bodies")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.create_subscription(Timing, f"{front_of()}/timing", self._on_timing, 10)

    def wait_for(self, condition: Any, what: str) -> None:
        """Handles messages until the condition holds."""
        end = monotonic() + START_LIMIT
        while not condition():
            if monotonic() > end:
                raise TimeoutError(f"no {what} after {START_LIMIT:.0f} s; the fleet: {self.values}")
            rclpy.spin_once(self, timeout_sec=0.1)

    def spawn(self, count: int) -> None:
        """Has the fleet spawn so many balls in a square."""
        side = max(round(count**0.5), 1)
        ball = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.25])
        request = SpawnBodies.Request()
        for index in range(count):
            body = BodySpecification(id=f"ball_{index}", shape=ball, mass=5.0)
            body.pose.position.x = APART * (index % side - 0.5 * side)
            body.pose.position.y = APART * (index // side - 0.5 * side)
            body.pose.position.z = HIGH
            request.bodies.append(body)
        self.wait_for(self._spawner.service_is_ready, "front")
        future = self._spawner.call_async(request)
        self.wait_for(future.done, "answer of the front")
        if not future.result().success:
            raise RuntimeError(f"bodies were not spawned: {future.result().message}")

    def line(self) -> str:
        """How the fleet is, in one line."""
        counts = "  ".join(f"{name}: {value}" for name, value in self.values.items())
        return f"real-time {self.factor:.2f}  {counts}"

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "fleet: nodes":
                self.values = {pair.key.removesuffix("/terrain_collider"): pair.value for pair in status.values}

    def _on_timing(self, message: Timing) -> None:
        self.factor = message.real_time_factor


@contextmanager
def processes(plan: FleetPlan, folder: Path) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """The fleet as processes by name, which end with the block."""
    commands = commands_of(plan, folder)
    running = {name: subprocess.Popen(command) for name, command in commands.items()}
    try:
        yield running
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def commands_of(plan: FleetPlan, folder: Path) -> dict[str, list[str]]:
    """The commands of all processes by name."""
    nodes = {f"node_{index}": plan.node(index, folder) for index in range(plan.count)}
    return {"source": plan.source_command(folder), "front": plan.front_command(folder), **nodes}


def start_again(running: dict[str, subprocess.Popen[bytes]], commands: dict[str, list[str]]) -> None:
    """Starts those that have ended again."""
    for name, process in list(running.items()):
        if process.poll() is not None:
            print(f"{name} ended with {process.returncode}; it is started again", flush=True)
            running[name] = subprocess.Popen(commands[name])


def run(plan: FleetPlan, bodies: int, seconds: float) -> None:
    """Runs a fleet with so many bodies, printing a line a second."""
    rclpy.init()
    watcher = Watcher()
    try:
        with tempfile.TemporaryDirectory() as name, processes(plan, Path(name)) as running:
            print(f"starting {plan.count} nodes ...", flush=True)
            watcher.wait_for(
                lambda: sum(value.endswith("bodies") for value in watcher.values.values()) == plan.count, "fleet"
            )
            watcher.spawn(bodies)
            end, due = monotonic() + seconds, 0.0
            while monotonic() < end:
                rclpy.spin_once(watcher, timeout_sec=0.1)
                start_again(running, commands_of(plan, Path(name)))
                if monotonic() >= due:
                    due = monotonic() + 1.0
                    print(watcher.line(), flush=True)
    except (TimeoutError, RuntimeError) as error:
        sys.exit(f"fleet failed: {error}")
    except KeyboardInterrupt:
        pass
    finally:
        watcher.destroy_node()
        rclpy.try_shutdown()


def main(args: list[str] | None = None) -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=4, help="nodes that share the terrain")
    parser.add_argument("--bodies", type=int, default=100, help="balls on it")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="how long; else until Ctrl-C")
    parser.add_argument("--spread", choices=("fewest", "tiles"), default="fewest", help="how bodies are spread")
    parser.add_argument("--respawn", choices=("elsewhere", "same"), default="elsewhere", help="bodies of a dead node")
    options = parser.parse_args(args)
    use_large_message_profile()
    plan = FleetPlan(count=options.nodes, source=SOURCE, front={"spread": options.spread, "respawn": options.respawn})
    with isolated_unless_chosen():
        run(plan, options.bodies, options.seconds)
