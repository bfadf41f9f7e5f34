"""Messages that end with a sequence, serialised to bytes."""

from __future__ import annotations

from collections import defaultdict
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
        self._buffer = np.zeros(4096, np.uint8)
        self._buffer[:4] = np.frombuffer(HEADER, np.uint8)
        self._end = 0
        self._count = 0
        self._count_at = 0
        # Keys of the groups in this message and in the last one. Constant bytes are reused up to the first difference.
        self._added: list[Hashable] = []
        self._before: list[Hashable] = []

    def start(
        self,
        key: Hashable,
        empty: Callable[[], Any],
        header: Header | None = None,
        fields: dict[str, Any] | None = None,
    ) -> None:
        """Starts a message: writes the fields before the sequence, with the ``header``'s stamp and other ``fields``.

        ``empty``: returns the message with an empty sequence; called once per ``key``, or always if that is None.
        """
        layout = self._layouts.get(("empty", key)) or Elements(empty())
        if key is not None:
            self._layouts["empty", key] = layout
        self._make_room(0, layout.size_bound(1))
        self._end = layout.put(
            self._buffer[4:], 0, 1, {**({} if header is None else stamp_fields(header)), **(fields or {})}
        )
        self._before, self._added = self._added, [self._end]
        self._count_at = self._end - 4  # the sequence's length comes last
        self._count = 0

    def add(self, key: Hashable, template: Callable[[], Any], count: int, fields: dict[str, Any]) -> None:
        """Adds ``count`` elements. ``template``: returns the template element; called once per ``key``."""
        layout = self._layouts.get(key)
        if layout is None:
            layout = self._layouts[key] = Elements(template())
        self._make_room(self._end, layout.size_bound(count))
        self._added.append((key, count, *fields))
        same = self._added == self._before[: len(self._added)]
        self._end = layout.put(self._buffer[4:], self._end, count, fields, same=same)
        self._count += count

    def finish(self) -> bytes:
        """Return the message's bytes."""
        at = 4 + self._count_at
        self._buffer[at : at + 4] = np.frombuffer(np.uint32(self._count).astype("<u4").tobytes(), np.uint8)
        return self._buffer[: 4 + self._end].tobytes()

    def _make_room(self, used: int, more: int) -> None:
        """Grows the buffer, if necessary, to hold ``more`` bytes after the ``used`` ones."""
        need = 4 + used + more
        if need > len(self._buffer):
            grown = np.zeros(2 * need, np.uint8)
            grown[: 4 + used] = self._buffer[: 4 + used]
            self._buffer = grown
            self._before = []


def stamp_fields(header: Header) -> dict[str, Any]:
    """Return the fields of a header's stamp."""
    return {"header.stamp.sec": header.stamp.sec, "header.stamp.nanosec": header.stamp.nanosec}


def by_length(texts: list[str]) -> Iterator[tuple[NDArray[np.int64], list[str]]]:
    """Yield the texts grouped by length in bytes, with their indices."""
    groups: dict[int, list[int]] = defaultdict(list)
    for index, text in enumerate(texts):
        groups[len(text.encode())].append(index)
    for indices in groups.values():
        yield np.array(indices), [texts[index] for index in indices]
