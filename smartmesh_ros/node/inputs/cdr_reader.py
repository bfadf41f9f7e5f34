"""Reads messages from their CDR bytes, arrays of numbers without a copy."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError


class Stamped(NamedTuple):
    """The first fields of every terrain message: stamp (seconds and nanoseconds), frame and tile."""

    sec: int
    nanosec: int
    frame_id: str
    tile: str


class CdrReader:
    """Reads fields in the order of the message definition. Raises `InputError` if the bytes end too soon.

    ``at``: number of bytes read after the 4-byte header.
    """

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise InputError("malformed", f"{len(data)} bytes that do not start as plain CDR")
        self._order = "<" if data[1] else ">"
        self._data = memoryview(data)[4:]
        self.at = 0

    def number(self, code: str) -> Any:
        """Read one number, given its `struct` code."""
        return self.numbers(code, 1)[0]

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Read ``count`` consecutive numbers, given their `struct` code."""
        return struct.unpack(f"{self._order}{count}{code}", self.skip(struct.calcsize(code), count))

    def text(self) -> str:
        """Read a string."""
        data = bytes(self.skip(1, self.number("I"))).rstrip(b"\0")
        if b"\0" in data:  # C code would read a shorter name than this one
            raise InputError("malformed", f"a string of {len(data)} bytes has a zero byte in it")
        try:
            return data.decode()
        except UnicodeDecodeError:
            raise InputError("malformed", f"a string of {len(data)} bytes is not UTF-8") from None

    def count(self, size: int) -> int:
        """Read the length of a sequence; the bytes left must hold so many elements of at least ``size`` bytes each."""
        count = int(self.number("I"))
        if count * size > len(self._data) - self.at:
            raise InputError("malformed", f"{count} elements from byte {self.at} of {len(self._data)} on")
        return count

    def sequence(self, dtype: str, width: int = 1) -> NDArray[Any]:
        """Read a sequence of numbers, or of ``width`` numbers each, as a view (n,) or (n, width) of the bytes."""
        kind = np.dtype(self._order + dtype)
        array = np.frombuffer(self.skip(kind.itemsize, self.number("I") * width), kind)
        return array if width == 1 else array.reshape(-1, width)

    def stamped(self) -> Stamped:
        """Read header and tile."""
        return Stamped(self.number("i"), self.number("I"), self.text(), self.text())

    def skip(self, size: int, count: int = 1) -> memoryview:
        """Skip ``count`` numbers of ``size`` bytes each, and return their bytes."""
        if not count:  # no alignment either
            return self._data[:0]
        start = -(-self.at // size) * size
        end = start + size * count
        if end > len(self._data):
            raise InputError("malformed", f"the message ends after {len(self._data)} bytes; a field needs {end}")
        self.at = end
        return self._data[start:end]
