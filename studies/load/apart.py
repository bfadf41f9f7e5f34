"""A prototype with physics in a second process: maps are passed in shared memory.

The ROS process writes maps into one of two shared buffers; the physics process steps a world and copies the newest
buffer into its map. Markers and services are left out, because the comparison of executors does not need them.
"""

from __future__ import annotations

import struct
from multiprocessing import Process, Queue, get_context
from multiprocessing.shared_memory import SharedMemory
from time import monotonic, sleep
from typing import Any

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import Heightmap, StageTiming, Timing, TrackedBodyArray

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.world import World, WorldConfig
from studies.load.cases import MAX_VELOCITY, RESOLUTION

# The newest map's number, at the start of the shared memory; map k lies in buffer k % 2.
HEAD = 64


def physics(memory_name: str, side: int, rate: float, spawn: list[dict[str, Any]], reports: Any) -> None:
    """The physics process: steps at ``rate`` [Hz] and reports once a second."""
    memory = SharedMemory(memory_name)
    head: Any = memory.buf
    buffers = np.ndarray((2, side, side), np.float32, memory.buf, HEAD)
    world = World(config=WorldConfig(physics=PhysicsConfig(rate=rate)))
    terrain = HeightMap(buffers[1], resolution=RESOLUTION, motion=MotionConfig(max_velocity=MAX_VELOCITY))
    world.terrain.put("", terrain)
    for entry in spawn:
        x, y = entry["xy"]
        world.spawn(entry["id"], Sphere(*entry["size"]), entry["mass"], BodyState((x, y, entry["above"])))
    period, taken, misses, late = 1.0 / rate, 0, 0, Stopwatch(("lateness",))
    window = monotonic()
    due, steps = window + period, 0
    while True:
        newest = struct.unpack_from("<q", head, 0)[0]
        if newest > taken:
            with world.stopwatch.stage("ingest"):
                terrain.replace(buffers[newest % 2], time=world.time)
            taken = newest
        sleep(max(due - monotonic(), 0.0))
        now = monotonic()
        late.note("lateness", max(now - due, 0.0))
        missed = max(int((now - due) / period), 0)
        misses += missed
        due += (missed + 1) * period
        world.step()
        steps += 1
        if now - window >= 1.0:
            stages = [tuple(times) for times in (*world.stopwatch.read(), *late.read())]
            reports.put((now - window, steps * period / (now - window), misses, stages, len(world.bodies), taken))
            window, steps, misses = now, 0, 0


class Apart(Node):
    """The ROS process."""

    def __init__(self) -> None:
        super().__init__("apart_collider", automatically_declare_parameters_from_overrides=True)
        self._spawn = [yaml.safe_load(text) for text in self.get_parameter("bodies.spawn").value]
        self._rate = float(self.get_parameter("physics.rate").value)
        self._reports: Queue[Any] = get_context("spawn").Queue()
        self._memory: SharedMemory | None = None
        self._process: Process | None = None
        self._count = 0
        base = "terrain_collider"
        self.create_subscription(Heightmap, f"{base}/heightmap", self._on_map, 2, raw=True)
        self.create_subscription(TrackedBodyArray, f"{base}/tracked_bodies", lambda _: None, 10)
        self._timing = self.create_publisher(Timing, f"{base}/timing", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(0.2, self._pass_on)

    def close(self) -> None:
        """Ends the physics process."""
        if self._process is not None:
            self._process.terminate()
            self._process.join()
        if self._memory is not None:
            self._memory.close()
            self._memory.unlink()

    def _on_map(self, data: bytes) -> None:
        # The driver's maps are square without velocities and friction: the heights end eight bytes before the message.
        side = round(((len(data) - 104) / 4) ** 0.5)
        heights = np.frombuffer(data, np.float32, side * side, len(data) - 8 - 4 * side * side)
        if self._memory is None:
            self._memory = SharedMemory(create=True, size=HEAD + 8 * side * side)
            arguments = (self._memory.name, side, self._rate, self._spawn, self._reports)
            self._process = get_context("spawn").Process(target=physics, args=arguments, daemon=True)  # type: ignore[assignment]
            assert self._process is not None
            self._process.start()
        self._count += 1
        head: Any = self._memory.buf
        buffers = np.ndarray((2, side * side), np.float32, head, HEAD)
        buffers[self._count % 2] = heights
        del buffers
        struct.pack_into("<q", head, 0, self._count)

    def _pass_on(self) -> None:
        while not self._reports.empty():
            window, factor, misses, stages, bodies, taken = self._reports.get()
            message = Timing(window_s=window, real_time_factor=factor, deadline_misses=misses)
            message.stages = [
                StageTiming(stage=stage, count=runs, p50_us=p50, p99_us=p99, max_us=most)
                for stage, runs, p50, p99, most in stages
            ]
            self._timing.publish(message)
            values = {"simulated": bodies, "updates of ''": self._count, "maps used": taken}
            pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
            self._diagnostics.publish(DiagnosticArray(status=[DiagnosticStatus(name="apart", values=pairs)]))


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    rclpy.init()
    node = Apart()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.close()
        try_shutdown()


if __name__ == "__main__":
    main()
