"""A straightforward node: message objects throughout, each point of each marker an object of its own.

Physics and patches are the package's own, so that only the ROS side differs from ``terrain_collider``.
"""

from __future__ import annotations

from time import monotonic
from typing import Any

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import Heightmap, StageTiming, Timing, TrackedBodyArray
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.stopwatch import STAGES, Stopwatch
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.world import World, WorldConfig
from studies.load.cases import MAX_VELOCITY


class Naive(Node):
    """A timer steps the world; callbacks take messages."""

    def __init__(self) -> None:
        super().__init__("naive_collider", automatically_declare_parameters_from_overrides=True)
        rate = float(self.get_parameter("physics.rate").value)
        self._world = World(config=WorldConfig(physics=PhysicsConfig(rate=rate)))
        self._spawn = [yaml.safe_load(text) for text in self.get_parameter("bodies.spawn").value]
        self._period, self._due = 1.0 / rate, monotonic() + 1.0 / rate
        self._late = Stopwatch(("lateness",))
        self._misses = 0
        self._window = monotonic()
        self._taken = 0
        base = "terrain_collider"
        self.create_subscription(Heightmap, f"{base}/heightmap", self._on_map, 2)
        self.create_subscription(TrackedBodyArray, f"{base}/tracked_bodies", self._on_bodies, 10)
        self._markers = self.create_publisher(MarkerArray, f"{base}/patches", 10)
        self._timing = self.create_publisher(Timing, f"{base}/timing", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(self._period, self._step)
        self.create_timer(1.0 / float(self.get_parameter("publish.patches").value), self._publish_markers)
        self.create_timer(1.0, self._publish_health)

    def _on_map(self, message: Heightmap) -> None:
        world = self._world
        with world.stopwatch.stage("ingest"):
            heights = np.array(message.heights, np.float32).reshape(message.info.height, message.info.width)
            known = world.terrain.tiles.get("")
            if isinstance(known, HeightMap):
                known.replace(heights, time=world.time)
            else:
                motion = MotionConfig(max_velocity=MAX_VELOCITY)
                world.terrain.put("", HeightMap(heights, resolution=message.info.resolution, motion=motion))
        self._taken += 1
        for entry in self._spawn:
            x, y = entry["xy"]
            world.spawn(entry["id"], Sphere(*entry["size"]), entry["mass"], BodyState((x, y, entry["above"])))
        self._spawn = []

    def _on_bodies(self, message: TrackedBodyArray) -> None:
        for body in message.bodies:
            p = body.pose.position
            self._world.track(body.id, body.radius, BodyState((p.x, p.y, p.z)))

    def _step(self) -> None:
        late = monotonic() - self._due
        self._late.note("lateness", max(late, 0.0))
        self._misses += max(int(late / self._period), 0)
        self._due += max(int(late / self._period), 0) * self._period + self._period
        self._world.step()

    def _publish_markers(self) -> None:
        with self._world.stopwatch.stage("publish"):
            message = MarkerArray()
            for batch in self._world.shown_batches():
                for body, vertices in zip(batch.bodies.tolist(), batch.vertices_w, strict=True):
                    marker = Marker(ns="patches", id=body, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
                    marker.header.frame_id = "map"
                    marker.header.stamp = self.get_clock().now().to_msg()
                    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
                    marker.color.r = marker.color.a = 1.0
                    for corner in batch.triangles.ravel():
                        x, y, z = vertices[corner]
                        marker.points.append(Point(x=float(x), y=float(y), z=float(z)))
                    message.markers.append(marker)
            self._markers.publish(message)

    def _publish_health(self) -> None:
        now = monotonic()
        times = (*self._world.stopwatch.read(), *self._late.read())
        stages = [
            StageTiming(stage=t.stage, count=t.runs, p50_us=t.p50_us, p99_us=t.p99_us, max_us=t.max_us) for t in times
        ]
        step = times[STAGES.index("step")].runs
        window, self._window = now - self._window, now
        self._timing.publish(
            Timing(
                window_s=window,
                stages=stages,
                deadline_misses=self._misses,
                real_time_factor=step * self._period / window,
            )
        )
        self._misses = 0
        values: dict[str, Any] = {
            "simulated": sum(not body.tracked for body in self._world.bodies.values()),
            "updates of ''": self._taken,
            "below ground": len(self._world.below_ground()),
        }
        pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        self._diagnostics.publish(DiagnosticArray(status=[DiagnosticStatus(name="naive", values=pairs)]))


def main() -> None:
    """Run the node until SIGINT or SIGTERM."""
    rclpy.init()
    try:
        rclpy.spin(Naive())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        try_shutdown()


if __name__ == "__main__":
    main()
