"""Body states of another node, straight from the bytes of its messages: an object for each body would take more of the
step than simulating it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.physics.state import Vector
from smartmesh_ros.physics.state_table import StateTable

Bytes = NDArray[np.uint8]
# What follows the name of a TrackedBody, from the next multiple of eight bytes on.
BODY = np.dtype(
    {
        "names": ["numbers", "radius", "shape", "dimensions", "centre", "mass"],
        "formats": [("<f8", (13,)), "<f4", "u1", ("<f4", (3,)), ("<f4", (3,)), "<f4"],
        "offsets": [0, 104, 108, 112, 124, 136],
        "itemsize": 140,
    }
)
BODY_BYTES = BODY.itemsize
# The least that a TrackedBody takes: its name's length and closing zero, and the above.
LEAST = 5 + BODY_BYTES
# States are published in the step that made them: they hold for no instant farther from their stamp than this [s].
MOST_AHEAD = 1.0


class PeerStates(NamedTuple):
    """A message: stamp (seconds and nanoseconds), frame, by how much the states hold later [s], steps per second [Hz],
    gravity [m/s^2], and the bodies."""

    sec: int
    nanosec: int
    frame_id: str
    ahead: float
    rate: float
    gravity: Vector
    bodies: StateTable


class PeerReader:
    """Reads the messages of one node; names are made anew only when they changed."""

    def __init__(self) -> None:
        self._data: Bytes = np.zeros(0, np.uint8)
        self._spans = np.zeros((0, 2), np.int64)
        self._names: list[str] = []

    def read(self, data: bytes, most: int, longest: int) -> PeerStates:
        """Return a TrackedBodyArray from its bytes. Raises `InputError` where they are none, or there are more than ``most``
        bodies, a name is longer than ``longest`` characters, or two are the same."""
        reader = CdrReader(data)
        if data[1] != 1:
            raise InputError("malformed", "big-endian body states; only little-endian ones are read")
        sec, nanosec, frame_id = reader.number("i"), reader.number("I"), reader.text()
        ahead, rate, *gravity = reader.numbers("f", 5)
        count = reader.count(LEAST)
        if count > most:
            raise InputError("size", f"{count} bodies are more than bodies.most = {most}")
        if not np.isfinite([ahead, rate, *gravity]).all():
            raise InputError("non_finite", f"ahead, rate, gravity are {ahead}, {rate}, {gravity}; all must be finite")
        if abs(ahead) > MOST_AHEAD:
            raise InputError("stamp", f"states hold {ahead} s after their stamp; at most {MOST_AHEAD:g} s can be")
        content = np.frombuffer(data, np.uint8)[4:]
        spans, rows = np.empty((count, 2), np.int64), np.empty((count, BODY_BYTES), np.uint8)
        if not split(content, reader.at, spans, rows):
            raise InputError("malformed", f"the message ends after {len(data)} bytes; {count} bodies need more")
        names = self._take_names(content, spans, longest)
        bodies = rows.view(BODY)[:, 0]
        table = StateTable(
            names, np.ascontiguousarray(bodies["numbers"]), bodies["radius"].astype(np.float64), bodies["shape"],
            bodies["dimensions"].astype(np.float64), bodies["centre"].astype(np.float64),
            bodies["mass"].astype(np.float64),
        )  # fmt: skip
        x, y, z = gravity
        return PeerStates(sec, nanosec, frame_id, ahead, rate, (x, y, z), table)

    def _take_names(self, content: Bytes, spans: NDArray[np.int64], longest: int) -> list[str]:
        if not same_texts(self._data, self._spans, content, spans):
            self._names = _names_in(content.tobytes(), spans, longest)
        self._data, self._spans = content, spans
        return self._names


def _names_in(content: bytes, spans: NDArray[np.int64], longest: int) -> list[str]:
    try:
        names = [content[start:end].decode() for start, end in spans.tolist()]
    except UnicodeDecodeError:
        raise InputError("malformed", "a body's name is not UTF-8") from None
    if len(set(names)) < len(names):
        raise InputError("duplicate_id", "a body is in the message twice; names must be distinct")
    for name in names:
        if not name or "/" in name or "\0" in name:
            raise InputError("empty_id", f"{name!r} cannot name a body; a name is not empty and has no '/'")
        if len(name) > longest:
            raise InputError("size", f"a name of {len(name)} characters; bodies.longest_name allows {longest}")
    return names


@compiled
def split(content: Bytes, at: int, spans: NDArray[np.int64], rows: Bytes) -> bool:
    """Where the names of bodies begin and end in a message's ``content`` (n, 2), from the byte ``at`` on, and what
    follows them (n, bytes of a body); False where the content ends too soon."""
    size = len(content)
    for i in range(len(spans)):
        at = (at + 3) // 4 * 4
        if at + 4 > size:
            return False
        length = 0
        for k in range(3, -1, -1):
            length = 256 * length + content[at + k]
        at += 4
        if length < 1 or at + length > size:
            return False
        spans[i, 0], spans[i, 1] = at, at + length - 1  # without the closing zero
        start = (at + length + 7) // 8 * 8
        at = start + BODY_BYTES
        if at > size:
            return False
        rows[i] = content[start:at]
    return True


@compiled
def same_texts(one: Bytes, spans: NDArray[np.int64], other: Bytes, other_spans: NDArray[np.int64]) -> bool:
    """Whether two contents have the same bytes in their spans (n, 2)."""
    if len(spans) != len(other_spans):
        return False
    for i in range(len(spans)):
        length = spans[i, 1] - spans[i, 0]
        if other_spans[i, 1] - other_spans[i, 0] != length:
            return False
        for k in range(length):
            if one[spans[i, 0] + k] != other[other_spans[i, 0] + k]:
                return False
    return True
