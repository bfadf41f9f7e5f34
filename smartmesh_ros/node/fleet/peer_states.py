"""Body states of another node, read directly from the message's bytes, because a Python object per body would cost
more time than simulating the body.

Nodes publish their states in every step. An executor that wakes for each message spends more time on that than on
reading the few that are needed. rclpy has no public way to take a message without an executor, so `Polled` keeps its
subscription from the executors by a callback group and calls ``handle.take_message``, as rclpy's executors do.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.inputs.conversions import require_distinct
from smartmesh_ros.world.state_table import StateTable

# Fields of a TrackedBody after its name; they start at the next multiple of eight bytes.
BODY_RECORD = np.dtype(
    {
        "names": ["numbers", "radius", "shape", "dimensions", "centre", "mass"],
        "formats": [("<f8", (13,)), "<f4", "u1", ("<f4", (3,)), ("<f4", (3,)), "<f4"],
        "offsets": [0, 104, 108, 112, 124, 136],
        "itemsize": 140,
    }
)
BODY_BYTES = BODY_RECORD.itemsize
# Minimum size of a TrackedBody [bytes]: length and closing zero of the name, and the fields after the name.
MIN_BODY_BYTES = 5 + BODY_BYTES
# Maximum time between a stamp and the instant its states hold for [s]; states are published in the step that made them.
MAX_AHEAD = 1.0
# Best effort and depth 1, because only the newest states are used.
NEWEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class PeerStates(NamedTuple):
    """Content of a TrackedBodyArray: stamp (``sec``, ``nanosec``), frame, ``ahead``: time from the stamp to the instant
    of the states [s], physics ``rate`` [Hz], ``gravity`` [m/s^2], and the bodies."""

    sec: int
    nanosec: int
    frame_id: str
    ahead: float
    rate: float
    gravity: Vector
    bodies: StateTable


class PeerReader:
    """Reads the messages of one node. Reuses the list of names while the names do not change."""

    def __init__(self) -> None:
        self._content = b""  # the names as in the message, each closed by a zero
        self._names: list[str] = []

    def read(self, data: bytes, max_bodies: int, max_name: int) -> PeerStates:
        """Return the content of a TrackedBodyArray's bytes. Raises `InputError` if the message is malformed, has more
        than ``max_bodies`` bodies or a name of more than ``max_name`` characters, or two bodies of one name."""
        reader = CdrReader(data)
        if data[1] != 1:
            raise InputError("malformed", "big-endian body states; only little-endian ones are read")
        sec, nanosec, frame_id = reader.number("i"), reader.number("I"), reader.text()
        ahead, rate, *gravity = reader.numbers("f", 5)
        count = reader.count(MIN_BODY_BYTES)
        if count > max_bodies:
            raise InputError("size", f"{count} bodies are more than bodies.most = {max_bodies}")
        if not np.isfinite([ahead, rate, *gravity]).all():
            raise InputError("non_finite", f"ahead, rate, gravity are {ahead}, {rate}, {gravity}; all must be finite")
        if abs(ahead) > MAX_AHEAD:
            raise InputError(
                "stamp", f"ahead is {ahead} s; it must be at most {MAX_AHEAD:g} s before or after the stamp"
            )
        rows = np.empty((count, BODY_BYTES), np.uint8)
        content = CORE.split_bodies(np.frombuffer(data, np.uint8)[4:], reader.at, rows)
        if content is None:
            raise InputError("malformed", f"the message ends after {len(data)} bytes; {count} bodies need more")
        if content != self._content or count != len(self._names):
            self._names, self._content = _names_in(content, count, max_name), content
        bodies = rows.view(BODY_RECORD)[:, 0]
        table = StateTable(
            self._names, np.ascontiguousarray(bodies["numbers"]), bodies["radius"].astype(np.float64),
            np.array(bodies["shape"]), bodies["dimensions"].astype(np.float64), bodies["centre"].astype(np.float64),
            bodies["mass"].astype(np.float64),
        )  # fmt: skip
        x, y, z = gravity
        return PeerStates(sec, nanosec, frame_id, ahead, rate, (x, y, z), table)


def _names_in(content: bytes, count: int, max_name: int) -> list[str]:
    try:
        names = content.decode().split("\0")[:-1]
    except UnicodeDecodeError:
        raise InputError("malformed", "a body's name is not UTF-8") from None
    if len(names) != count:  # C code would read a shorter name than this one
        raise InputError("empty_id", "a body's name has a zero byte in it")
    require_distinct(names)
    if (longest := max(map(len, names), default=0)) > max_name:
        raise InputError("size", f"a name of {longest} characters; at most {max_name} are possible")
    return names


class _Never(ReentrantCallbackGroup):
    """Callback group that an executor never runs."""

    def can_execute(self, entity: Any) -> bool:
        return False


class Polled:
    """A subscription of message type ``kind`` for which DDS keeps only the newest message."""

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._kind, self._group = kind, _Never()
        self._subscription = node.create_subscription(
            kind, topic, lambda _: None, NEWEST_QOS, callback_group=self._group, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message as bytes; None if no message arrived since the last call."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._kind, True)
        return None if taken is None else taken[0]
