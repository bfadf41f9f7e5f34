"""Body states of another node, read directly from the message's bytes, because a Python object per body would cost
more time than simulating the body."""

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
        self._data: Bytes = np.frombuffer(bytes(1), np.uint8)  # not writable, as messages
        self._spans = np.zeros((0, 2), np.int64)
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
        content = np.frombuffer(data, np.uint8)[4:]
        spans, rows = np.empty((count, 2), np.int64), np.empty((count, BODY_BYTES), np.uint8)
        if not split(content, reader.at, spans, rows):
            raise InputError("malformed", f"the message ends after {len(data)} bytes; {count} bodies need more")
        names = self._read_names(content, spans, max_name)
        bodies = rows.view(BODY_RECORD)[:, 0]
        table = StateTable(
            names, np.ascontiguousarray(bodies["numbers"]), bodies["radius"].astype(np.float64),
            np.array(bodies["shape"]), bodies["dimensions"].astype(np.float64), bodies["centre"].astype(np.float64),
            bodies["mass"].astype(np.float64),
        )  # fmt: skip
        x, y, z = gravity
        return PeerStates(sec, nanosec, frame_id, ahead, rate, (x, y, z), table)

    def _read_names(self, content: Bytes, spans: NDArray[np.int64], max_name: int) -> list[str]:
        if not same_texts(self._data, self._spans, content, spans):
            self._names = _names_in(content.tobytes(), spans, max_name)
        self._data, self._spans = content, spans
        return self._names


def _names_in(content: bytes, spans: NDArray[np.int64], max_name: int) -> list[str]:
    try:
        names = [content[start:end].decode() for start, end in spans.tolist()]
    except UnicodeDecodeError:
        raise InputError("malformed", "a body's name is not UTF-8") from None
    if len(set(names)) < len(names):
        raise InputError("duplicate_id", "a body is in the message twice; names must be distinct")
    for name in names:
        if not name or "/" in name or "\0" in name:
            raise InputError("empty_id", f"{name!r} cannot name a body; a name is not empty and has no '/'")
        if len(name) > max_name:
            raise InputError("size", f"a name of {len(name)} characters; bodies.longest_name allows {max_name}")
    return names


@compiled
def split(content: Bytes, at: int, spans: NDArray[np.int64], rows: Bytes) -> bool:
    """Split the bodies in a message's ``content`` that start at byte ``at``. Write the start and end of each name into
    ``spans`` (n, 2) and the fields after it into ``rows`` (n, BODY_BYTES). Return False if the content is too short."""
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
    """Return True if two contents have equal bytes in their spans (n, 2)."""
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
