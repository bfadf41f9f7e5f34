"""The process beside the node: publishes terrain, observes the outputs, and writes the results as JSON.

python -m studies.load.driver CASE.json RESULT.json
"""

from __future__ import annotations

import json
import sys
from collections import deque
from pathlib import Path
from time import monotonic, time_ns
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Pose
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate, Timing, TrackedBody, TrackedBodyArray
from visualization_msgs.msg import MarkerArray

from studies.load.cases import CODES, PROBE_HEIGHT, PROBE_RADIUS, RISE, Case
from studies.load.terrain_messages import FRAME, TerrainMessages

# How long the node may take to start and take the first map, and then to settle [s].
START_LIMIT, SETTLE = 90.0, 2.0
# Longest time that bodies have to fall asleep [s].
FALL_ASLEEP = 60.0
# What the first map may take to arrive before it is sent again, for each of its samples: 27 s for 16384 x 16384 [s].
SECONDS_PER_SAMPLE = 1e-7


class Driver(Node):
    """Publishes on time and keeps what arrives."""

    def __init__(self, case: Case) -> None:
        super().__init__("load_driver")
        self._case = case
        self._messages = TerrainMessages(case)
        self._maps = self.create_publisher(Heightmap, "terrain_collider/heightmap", QoSProfile(depth=2))
        self._regions = self.create_publisher(HeightmapUpdate, "terrain_collider/heightmap_update", 100)
        self._bodies = self.create_publisher(TrackedBodyArray, "terrain_collider/tracked_bodies", 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.create_subscription(Timing, "terrain_collider/timing", self._on_timing, 10)
        if case.markers:
            self.create_subscription(MarkerArray, "terrain_collider/patches", self._on_markers, 10, raw=True)
        self._executor = EventsExecutor()
        self._executor.add_node(self)
        self.health: dict[str, str] = {}
        self.windows: list[dict[str, Any]] = []
        self.latencies: list[float] = []
        self.sent = 0
        self._sent_at: deque[tuple[int, float]] = deque(maxlen=CODES - 1)
        self._code = -1
        self._measuring = False
        self._start = monotonic()

    def connected(self) -> bool:
        """Whether the node listens."""
        return bool(self._maps.get_subscription_count()) and bool(self._bodies.get_subscription_count())

    def listeners(self) -> int:
        """How many nodes take the maps."""
        return int(self._maps.get_subscription_count())

    def wait_for(self, condition: Any, what: str) -> None:
        """Handles messages until the condition holds."""
        end = monotonic() + START_LIMIT
        while not condition():
            if monotonic() > end:
                raise TimeoutError(f"no {what} after {START_LIMIT:.0f} s; last diagnostics {self.health}")
            self._executor.spin_once(timeout_sec=0.05)

    def start(self) -> None:
        """Sends the first map until it is taken and every body stands on it."""
        self.wait_for(self.connected, "node")
        due = 0.0

        def settled() -> bool:
            nonlocal due
            if monotonic() >= due:
                due = monotonic() + max(2.0, SECONDS_PER_SAMPLE * self._case.side**2)
                self.send(whole=True)
                self._track_probe()
            return self.health.get("simulated") == str(self._case.bodies)

        self.wait_for(settled, "bodies")

    def run(self, seconds: float) -> None:
        """Sends terrain at the case's rate for so long."""
        case = self._case
        next_map = monotonic()
        next_probe, end = next_map, next_map + seconds
        while (now := monotonic()) < end:
            if now >= next_map:
                next_map = max(next_map + 1.0 / case.map_rate, now)
                self.send(whole=case.mode == "full")
            if now >= next_probe:
                next_probe = now + 0.2
                self._track_probe()
            self._executor.spin_once(timeout_sec=max(min(next_map, next_probe, end) - monotonic(), 0.0))

    def measure(self) -> dict[str, Any]:
        """Runs the case; what was sent, taken, seen and timed meanwhile."""
        self.run(SETTLE)
        self._come_to_rest()
        self._quiet()
        before, sent = self.taken(), self.sent
        self.windows.clear()
        self.latencies.clear()
        self._measuring = True
        self.run(self._case.seconds)
        self._measuring = False
        windows = list(self.windows)
        self._quiet()
        return {
            "sent": self.sent - sent,
            "taken": self.taken() - before,
            "latencies_ms": [1e3 * latency for latency in self.latencies],
            "windows": windows,
            "below_ground": int(self.health.get("below ground", 0)),
        }

    def _come_to_rest(self) -> None:
        """Runs the case until the bodies on ground at rest sleep, a minute at most."""
        end = monotonic() + FALL_ASLEEP
        while int(self.health.get("asleep", 0)) < self._case.resting and monotonic() < end:
            self.run(1.0)

    def taken(self) -> int:
        """Maps and regions that the node has taken."""
        return int(self.health.get("updates of ''", 0))

    def send(self, *, whole: bool) -> None:
        """Sends the terrain as it is now."""
        now = monotonic()
        self._sent_at.append((self.sent, now))
        stamp, time = time_ns(), now - self._start
        if whole:
            self._maps.publish(self._messages.whole(self.sent, time, stamp))
        else:
            self._regions.publish(self._messages.region(self.sent, time, stamp))
        self.sent += 1

    def _quiet(self) -> None:
        """Sends nothing until the diagnostics have counted everything."""
        for _ in range(2):
            self.health.clear()
            self.wait_for(lambda: self.health, "diagnostics")

    def _track_probe(self) -> None:
        x, y = self._case.probe
        message = TrackedBodyArray()
        message.header.frame_id = FRAME
        pose = Pose(position=Point(x=x, y=y, z=PROBE_HEIGHT))
        message.bodies = [TrackedBody(id="probe", pose=pose, radius=PROBE_RADIUS)]
        self._bodies.publish(message)

    def _on_markers(self, data: bytes) -> None:
        """Notes when a code is first seen in the height of the probe's patch."""
        now = monotonic()
        numbers = np.frombuffer(data, "<f8", (len(data) - 4) // 8, 4)
        x, y = self._case.probe
        near = np.flatnonzero(np.abs(numbers[:-2] - x) < PROBE_RADIUS)
        near = near[np.abs(numbers[near + 1] - y) < PROBE_RADIUS]
        heights = numbers[near + 2] / RISE
        codes = {round(h) for h in heights.tolist() if -0.5 < h < CODES and abs(h - round(h)) < 0.02}
        if len(codes) != 1 or (code := codes.pop()) == self._code:
            return
        self._code = code
        if self._measuring:
            self.latencies += [now - sent for k, sent in self._sent_at if k % CODES == code]

    def _on_timing(self, message: Timing) -> None:
        stages = {s.stage: [s.count, s.p50_us, s.p99_us, s.max_us] for s in message.stages}
        self.windows.append(
            {
                "seconds": message.window_s,
                "real_time_factor": message.real_time_factor,
                "misses": message.deadline_misses,
                "stages": stages,
            }
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.health.update({pair.key: pair.value for pair in status.values})


def main() -> None:
    """Runs one case."""
    case = Case(**json.loads(Path(sys.argv[1]).read_text()))
    rclpy.init()
    driver = Driver(case)
    try:
        driver.start()
        print("started", flush=True)
        Path(sys.argv[2]).write_text(json.dumps(driver.measure()))
    finally:
        driver.destroy_node()
        try_shutdown()


if __name__ == "__main__":
    main()
