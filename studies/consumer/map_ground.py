"""MuJoCo's ground as one height field of the whole map, taken from the same topic as the node's."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from smartmesh_msgs.msg import Heightmap

from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from studies.consumer.cases import COLLIDER
from studies.consumer.rover import RANGE, WHEELS, FieldSpec, Rover


class MapGround:
    """Every new map is written whole into one field of ``rows`` x ``columns`` samples, ``resolution`` [m] apart, whose
    middle is the frame's origin. Between maps the ground stands still."""

    def __init__(self, rows: int, columns: int, resolution: float) -> None:
        self._shape = rows, columns
        self.received = 0
        self.costs: list[float] = []  # of taking each map [s]
        self._half = 0.5 * (columns - 1) * resolution, 0.5 * (rows - 1) * resolution
        self._stamp = math.inf
        self._data: bytes | None = None
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("map_ground", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(Heightmap, f"{COLLIDER}/heightmap", self._on_map, QoSProfile(depth=1), raw=True)

    def fields(self) -> list[FieldSpec]:
        """One, which all wheels collide with."""
        rows, columns = self._shape
        return [FieldSpec(name="ground", rows=rows, columns=columns, wheels=tuple(range(len(WHEELS))))]

    def close(self) -> None:
        """Ends the subscription."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def now(self) -> float:
        """The clock that stamps are of [s]."""
        return float(self._node.get_clock().now().nanoseconds * 1e-9)

    def ready(self, rover: Rover) -> bool:
        """Whether there is a map."""
        return self.received > 0

    def spin(self, timeout: float) -> None:
        """Takes what has arrived, waiting up to ``timeout`` [s]."""
        self._executor.spin_once(timeout_sec=timeout)

    def track(self, rover: Rover, now: float) -> None:
        """Nobody needs to know where the wheels are."""

    def update(self, rover: Rover, now: float) -> int:
        """Writes a map that came; returns how many wheels have no ground."""
        if self._data is not None:
            start = perf_counter()
            stamp, heights = read_map(self._data)
            self._stamp, self._data = stamp, None
            # The range is kept as the field's; in place, because the map is large.
            shares = heights * np.float32(1.0 / RANGE)
            shares += np.float32(0.5)
            rover.model.hfield_data[: shares.size] = shares
            rover.model.hfield_size[0] = *self._half, RANGE, 1.0
            rover.data.mocap_pos[0] = 0.0, 0.0, -0.5 * RANGE
            self.costs.append(perf_counter() - start)
        return 0

    def age(self, now: float) -> float:
        """Time since the stamp of the newest map [s]."""
        return now - self._stamp

    def _on_map(self, data: bytes) -> None:
        self._data = data
        self.received += 1


def read_map(data: bytes) -> tuple[float, NDArray[np.float32]]:
    """Stamp [s] and heights (n,) [m] of a Heightmap's bytes."""
    reader = CdrReader(data)
    sec, nanosec, _, _ = reader.stamped()
    reader.skip(4, 5)  # load time, resolution, width, height
    reader.skip(8, 7)  # origin
    return sec + 1e-9 * nanosec, reader.sequence("f4")
