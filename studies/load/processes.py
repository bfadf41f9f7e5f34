"""A node that watches a collider in a process of its own, and what that process takes."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any, Self

import psutil
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import Timing

COLLIDER = "/terrain_collider"
# How long nodes may take to start and take the first map, and to answer [s].
LIMIT = 180.0


class Watcher(Node):
    """The node of a study beside a collider. ``health``: values of its newest diagnostics by key. ``windows``: its
    timings. A context manager of ROS in this process."""

    def __init__(self) -> None:
        rclpy.init()
        super().__init__("study")
        self._executor = EventsExecutor()
        self._executor.add_node(self)
        self.health: dict[str, str] = {}
        self.windows: list[Timing] = []
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.create_subscription(Timing, f"{COLLIDER}/timing", self.windows.append, 10)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.destroy_node()
        try_shutdown()

    def spin(self, seconds: float, until: Callable[[], Any] = lambda: False) -> bool:
        """Handle messages for so long, or until a condition holds; return whether it does."""
        end = monotonic() + seconds
        while not until() and (left := end - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.05))
        return bool(until())

    def wait_for(self, condition: Callable[[], Any], what: str) -> None:
        """Handle messages until a condition holds. Raises `TimeoutError`."""
        if not self.spin(LIMIT, condition):
            raise TimeoutError(f"no {what} after {LIMIT:.0f} s; last diagnostics {self.health}")

    def call(self, client: Any, request: Any) -> Any:
        """Return the answer of a service. Raises `TimeoutError`."""
        future = client.call_async(request)
        self.wait_for(future.done, f"answer from {client.srv_name}")
        return future.result()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.health = {pair.key: pair.value for status in message.status for pair in status.values}


class Usage:
    """Processor time and memory of a process and its children."""

    def __init__(self, pid: int) -> None:
        self._process = psutil.Process(pid)

    def processes(self) -> list[psutil.Process]:
        """The process and its children."""
        return [self._process, *self._process.children(recursive=True)]

    def cpu(self) -> float:
        """Processor time so far [s]."""
        return sum(sum(process.cpu_times()[:2]) for process in self.processes())

    def memory(self) -> dict[str, float]:
        """Resident memory, its part that is shared memory of DDS, and its highest value so far [MiB]."""
        totals = dict.fromkeys(("VmRSS", "RssShmem", "VmHWM"), 0.0)
        for process in self.processes():
            for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
                key, _, value = line.partition(":")
                if key in totals:
                    totals[key] += float(value.split()[0]) / 1024.0
        return {"resident": totals["VmRSS"], "shared": totals["RssShmem"], "peak": totals["VmHWM"]}
