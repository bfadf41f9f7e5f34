"""The driver's terrain as ready bytes: one message is made, and each time only what moves is written into it."""

from __future__ import annotations

import array
import struct

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import Heightmap, HeightmapUpdate

from studies.load.cases import CODES, RESOLUTION, RIM, RIM_SLOPE, RISE, WAVE, Case

FRAME = "map"


class TerrainMessages:
    """Maps and regions of a case; the k-th has the probe's ground at code ``k % CODES``."""

    def __init__(self, case: Case) -> None:
        side, window = case.side, case.window
        message = Heightmap(heights=_floats(side * side))
        message.header.frame_id = FRAME
        message.info.resolution, message.info.width, message.info.height = RESOLUTION, side, side
        self._map = np.frombuffer(serialize_message(message), np.uint8).copy()
        # The heights are followed by the lengths of no velocities and no friction.
        self._map_heights = np.ndarray((side, side), "<f4", self._map, len(self._map) - 8 - 4 * side * side)
        update = HeightmapUpdate(width=window, height=window, heights=_floats(window * window))
        update.header.frame_id = FRAME
        self._region = np.frombuffer(serialize_message(update), np.uint8).copy()
        at = len(self._region) - 4 - 4 * window * window
        self._region_heights = np.ndarray((window, window), "<f4", self._region, at)
        steps = np.arange(window) * RESOLUTION
        self._x, y = np.meshgrid(steps, steps)
        # Still at the window's edge, so that nothing tears, and higher there, so that nobody rolls off.
        room = np.minimum.reduce([self._x, y, self._x[::-1, ::-1], y[::-1, ::-1]])
        self._swell = WAVE[0] * np.clip(room / RIM, 0.0, 1.0)
        self._rim = RIM_SLOPE * np.maximum(RIM - room, 0.0)
        x, probe_y = case.probe
        self._flat = (np.abs(self._x - x) <= 0.65) & (np.abs(y - probe_y) <= 0.65)

    def heights(self, k: int, time: float) -> NDArray[np.float32]:
        """The part that moves (window, window) [m]."""
        wave = self._swell * np.sin(WAVE[1] * self._x - WAVE[2] * time)
        wave += self._rim
        wave[self._flat] = RISE * (k % CODES)
        result: NDArray[np.float32] = wave.astype(np.float32)
        return result

    def whole(self, k: int, time: float, stamp_ns: int) -> bytes:
        """A Heightmap."""
        moving = self.heights(k, time)
        self._map_heights[: len(moving), : len(moving)] = moving
        return _stamped(self._map, stamp_ns)

    def region(self, k: int, time: float, stamp_ns: int) -> bytes:
        """A HeightmapUpdate."""
        self._region_heights[:] = self.heights(k, time)
        return _stamped(self._region, stamp_ns)


def _stamped(buffer: NDArray[np.uint8], stamp_ns: int) -> bytes:
    struct.pack_into("<iI", buffer.data, 4, *divmod(stamp_ns, 1_000_000_000))
    return buffer.tobytes()


def _floats(count: int) -> array.array[float]:
    values = array.array("f")
    values.frombytes(bytes(4 * count))
    return values
