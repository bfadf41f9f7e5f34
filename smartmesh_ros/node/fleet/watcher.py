"""A node that reads the diagnostics of a fleet's front and spawns bodies through the front."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import SpawnBodies

from smartmesh_ros.node.fleet.layout import front_of

# Limit of every wait [s], generous for a busy machine.
TIMEOUT = 120.0
MASS = 5.0  # of a ball [kg]


class FleetWatcher(Node):
    """Follows a fleet's front. ``front``: values of its diagnostics by key; the status message has the key ""."""

    def __init__(self) -> None:
        super().__init__("fleet_watcher")
        self.front: dict[str, str] = {}
        self._spawner = self.create_client(SpawnBodies, f"{front_of()}/spawn_bodies")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def wait_for(self, condition: Callable[[], Any], what: str) -> float:
        """Handle messages until the condition holds; return the time waited [s]. Raises `TimeoutError`."""
        start = monotonic()
        while not condition():
            if monotonic() > start + TIMEOUT:
                raise TimeoutError(f"no {what} after {TIMEOUT:.0f} s; the front says {self.front}")
            rclpy.spin_once(self, timeout_sec=0.05)
        return monotonic() - start

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
