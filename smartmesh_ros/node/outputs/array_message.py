"""Messages that end with a sequence, serialised to bytes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header

from smartmesh_ros.node.outputs.cdr import HEADER, Elements


class ArrayMessage:
    """A message that ends with a sequence, written in groups of equal elements into a reused buffer."""

    def __init__(self) -> None:
        self._layouts: dict[Hashable, Elements] = {}
        self._buffer = np.zeros(4096, np.uint8)  # without the CDR header
        self._end = self._start = self._count = 0  # what is written; of the sequence: where it starts, its length

    def start(self, key: Hashable, empty: Callable[[], Any], fields: dict[str, Any] | None = None) -> None:
        """Starts a message: writes what is before the sequence, with these values of ``fields``.

        ``empty``: returns the message with an empty sequence; called once per ``key``, or always if that is None.
        """
        if key is None:
            self._layouts.pop(("empty", None), None)
        self._end = 0
        self.add(("empty", key), empty, 1, fields or {})
        self._start, self._count = self._end, 0

    def add(self, key: Hashable, template: Callable[[], Any], count: int, fields: dict[str, Any]) -> None:
        """Adds ``count`` elements. ``template``: returns the template element; called once per ``key``."""
        if key not in self._layouts:
            self._layouts[key] = Elements(template())
        layout = self._layouts[key]
        if (need := self._end + layout.size_bound(count)) > len(self._buffer):
            self._buffer = np.append(self._buffer[: self._end], np.zeros(2 * need, np.uint8))
        self._end = layout.put(self._buffer, self._end, count, fields)
        self._count += count

    def finish(self) -> bytes:
        """Return the message's bytes."""
        self._buffer[: self._start][-4:] = np.array([self._count], "<u4").view(np.uint8)  # the sequence's length
        return b"".join([HEADER, self._buffer[: self._end].data])


def stamp_fields(header: Header) -> dict[str, Any]:
    """Return the fields of a header's stamp."""
    return {"header.stamp.sec": header.stamp.sec, "header.stamp.nanosec": header.stamp.nanosec}


def by_length(texts: list[str]) -> Iterator[tuple[NDArray[np.int64], list[str]]]:
    """Yield the texts grouped by length in bytes, with their indices."""
    groups: dict[int, list[int]] = {}
    for index, text in enumerate(texts):
        groups.setdefault(len(text.encode()), []).append(index)
    for indices in groups.values():
        yield np.array(indices), [texts[index] for index in indices]
