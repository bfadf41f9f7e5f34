"""Publishes the ground of a case until SIGINT or SIGTERM.

python -m studies.consumer.publish CASE.json
"""

from __future__ import annotations

import array
import json
import struct
import sys
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import Heightmap

from studies.consumer.cases import COLLIDER, FRAME, Case, TrueGround


class Publisher(Node):
    """Whole maps at the case's rate, stamped with the instant that their heights hold for."""

    def __init__(self, case: Case) -> None:
        super().__init__("consumer_terrain")
        self._ground = TrueGround(case)
        geometry = self._ground.geometry
        message = Heightmap(heights=array.array("f", bytes(4 * geometry.size)))
        message.header.frame_id = FRAME
        message.info.resolution, message.info.width, message.info.height = (
            geometry.resolution, geometry.columns, geometry.rows,
        )  # fmt: skip
        origin = message.info.origin.position
        origin.x, origin.y, origin.z = geometry.origin
        self._bytes = np.frombuffer(serialize_message(message), np.uint8).copy()
        # After the heights: the lengths of the empty arrays of velocities and friction.
        at = len(self._bytes) - 8 - 4 * geometry.size
        self._heights = np.ndarray((geometry.rows, geometry.columns), "<f4", self._bytes, at)
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publisher = self.create_publisher(Heightmap, f"{COLLIDER}/heightmap", qos)
        self.create_timer(1.0 / case.map_rate, self._publish)

    def _publish(self) -> None:
        stamp = self.get_clock().now().nanoseconds
        self._heights[...] = self._ground.heights(stamp * 1e-9)
        struct.pack_into("<iI", self._bytes.data, 4, *divmod(stamp, 1_000_000_000))
        self._publisher.publish(self._bytes.tobytes())


def main() -> None:
    """Publishes until SIGINT or SIGTERM."""
    case = Case(**json.loads(Path(sys.argv[1]).read_text()))
    rclpy.init()
    try:
        rclpy.spin(Publisher(case))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        try_shutdown()


if __name__ == "__main__":
    main()
