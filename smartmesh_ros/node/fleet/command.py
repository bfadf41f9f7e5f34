"""``smartmesh-fleet``: several nodes on one moving terrain, their front, and bodies, without a ROS installation.

A process that ends is restarted. Stop the fleet with Ctrl-C or SIGTERM, or set --seconds.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification, Timing
from smartmesh_msgs.srv import SpawnBodies

from smartmesh_ros.node.fleet.layout import commands, front_of
from smartmesh_ros.node.parameters.settings import MOST_BODIES
from smartmesh_ros.node.running import Stop, init
from smartmesh_ros.startup.arguments import Parser, number
from smartmesh_ros.startup.dds import isolated_unless_chosen, use_large_message_profile

# Limit of every wait [s], generous for a busy machine.
TIMEOUT = 120.0
MASS = 5.0  # of a ball [kg]
# Spacing of the balls' square grid, their start height and radius [m].
SPACING, START_HEIGHT, RADIUS = 0.9, 0.8, 0.25


class FleetWatcher(Node):
    """Follows a fleet's front. ``front``: values of its diagnostics by key; the status message has the key ""."""

    def __init__(self) -> None:
        super().__init__("fleet_watcher")
        self.front: dict[str, str] = {}
        self._spawner = self.create_client(SpawnBodies, f"{front_of()}/spawn_bodies")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def wait_for(self, condition: Callable[[], Any], what: str) -> None:
        """Handle messages until the condition holds. Raises `TimeoutError`."""
        end = monotonic() + TIMEOUT
        while not condition():
            if monotonic() > end:
                raise TimeoutError(f"no {what} after {TIMEOUT:.0f} s; the front says {self.front}")
            rclpy.spin_once(self, timeout_sec=0.05)

    def spawn_balls(self, balls: Iterable[tuple[str, float, float, float]], radius: float) -> None:
        """Spawn balls (name, x, y, z) [m] of a ``radius`` [m] through the front. Raises `RuntimeError` if refused."""
        request = SpawnBodies.Request()
        shape = SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[radius])
        for name, x, y, z in balls:
            body = BodySpecification(id=name, shape=shape, mass=MASS)
            body.pose.position.x, body.pose.position.y, body.pose.position.z = x, y, z
            request.bodies.append(body)
        self.wait_for(self._spawner.service_is_ready, "front")
        future = self._spawner.call_async(request)
        self.wait_for(future.done, "answer of the front")
        if not future.result().success:
            raise RuntimeError(f"bodies were not spawned: {future.result().message}")

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "fleet: nodes":
                self.front = {pair.key: pair.value for pair in status.values} | {"": status.message}


def grid(count: int) -> Iterator[tuple[str, float, float, float]]:
    """Yield ``count`` balls (name, x, y, z) [m] in a square grid."""
    side = max(round(count**0.5), 1)
    for index in range(count):
        row, column = divmod(index, side)
        yield f"ball_{index}", SPACING * (column - 0.5 * side), SPACING * (row - 0.5 * side), START_HEIGHT


@contextmanager
def processes(commands: dict[str, list[str]]) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Run commands by name as processes for the length of the block; yield the processes."""
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, command in commands.items():
            running[name] = subprocess.Popen(command)
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


def run(nodes: int, front: dict[str, str], bodies: int, seconds: float) -> None:
    """Run a fleet of ``nodes``, whose front has some parameters, with ``bodies`` balls for ``seconds`` [s], printing a
    line a second."""
    init()
    watcher, last = FleetWatcher(), {"timing": Timing()}
    watcher.create_subscription(Timing, f"{front_of()}/timing", partial(last.__setitem__, "timing"), 10)
    Stop()  # the first signal raises KeyboardInterrupt; later ones leave the processes the time to end
    try:
        with tempfile.TemporaryDirectory() as name, processes(made := commands(Path(name), nodes, front)) as running:
            print(f"starting {nodes} nodes ...", flush=True)
            watcher.wait_for(lambda: watcher.front.get("") == f"{nodes} nodes", "fleet")
            watcher.spawn_balls(grid(bodies), RADIUS)
            end, due = monotonic() + seconds, 0.0
            while monotonic() < end:
                rclpy.spin_once(watcher, timeout_sec=0.1)
                for ended, process in running.items():
                    if process.poll() is not None:
                        print(f"{ended} ended with exit code {process.returncode}; restarting it", flush=True)
                        running[ended] = subprocess.Popen(made[ended])
                if monotonic() >= due:
                    due = monotonic() + 1.0
                    known = watcher.front.items()
                    words = [f"{key.removesuffix('/terrain_collider')}: {value}" for key, value in known if key]
                    print(f"real-time {last['timing'].real_time_factor:.2f}  {'  '.join(words)}", flush=True)
    except (TimeoutError, RuntimeError) as error:
        sys.exit(f"fleet failed: {error}")
    except KeyboardInterrupt:
        pass
    finally:
        watcher.destroy_node()
        rclpy.try_shutdown()


def main(args: list[str] | None = None) -> None:
    parser = Parser(description=__doc__)
    parser.add_argument("--nodes", type=number(int, 1, 100), default=4, help="nodes that share the terrain")
    parser.add_argument("--bodies", type=number(int, 0, MOST_BODIES), default=100, help="balls on it")
    seconds = number(float, 0.0, math.inf)
    parser.add_argument("--seconds", type=seconds, default=math.inf, help="duration; default: until Ctrl-C")
    parser.add_argument(
        "--spread", choices=("fewest", "tiles"), default="fewest", help="rule that assigns bodies to nodes"
    )
    parser.add_argument("--respawn", choices=("elsewhere", "same"), default="elsewhere", help="bodies of a dead node")
    options = parser.parse_args(args)
    use_large_message_profile()
    with isolated_unless_chosen():
        front = {"spread": options.spread, "respawn": options.respawn}
        run(options.nodes, front, options.bodies, options.seconds)
