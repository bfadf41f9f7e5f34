"""Messages that end with a sequence, as ready bytes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header

from smartmesh_ros.node.outputs.cdr import HEADER, Elements


class ArrayMessage:
    """A message that ends with a sequence, written element group by element group into one reused buffer."""

    def __init__(self) -> None:
        self._layouts: dict[Hashable, Elements] = {}
        self._buffer = np.zeros(4096, np.uint8)
        self._buffer[:4] = np.frombuffer(HEADER, np.uint8)
        self._end = 0
        self._count = 0
        self._count_at = 0
        # What was added where in this message and in the one before: where nothing differs, the constant bytes stand.
        self._added: list[Hashable] = []
        self._before: list[Hashable] = []

    def start(
        self,
        key: Hashable,
        empty: Callable[[], Any],
        header: Header | None = None,
        fields: dict[str, Any] | None = None,
    ) -> None:
        """Begins a message with what comes before the sequence: its header's stamp if it has one, and other ``fields``.

        ``empty``: makes the message with an empty sequence, called once per ``key``; None = never the same again.
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
        """Adds ``count`` elements. ``template``: makes the template element, called once per ``key``."""
        layout = self._layouts.get(key)
        if layout is None:
            layout = self._layouts[key] = Elements(template())
        self._make_room(self._end, layout.size_bound(count))
        self._added.append((key, count, *fields))
        same = self._added == self._before[: len(self._added)]
        self._end = layout.put(self._buffer[4:], self._end, count, fields, same=same)
        self._count += count

    def finish(self) -> bytes:
        """The message's bytes."""
        at = 4 + self._count_at
        self._buffer[at : at + 4] = np.frombuffer(np.uint32(self._count).astype("<u4").tobytes(), np.uint8)
        return self._buffer[: 4 + self._end].tobytes()

    def _make_room(self, used: int, more: int) -> None:
        """Lets ``more`` bytes follow those ``used``."""
        need = 4 + used + more
        if need > len(self._buffer):
            grown = np.zeros(2 * need, np.uint8)
            grown[: 4 + used] = self._buffer[: 4 + used]
            self._buffer = grown
            self._before = []


def stamp_fields(header: Header) -> dict[str, Any]:
    """The fields of a header's stamp."""
    return {"header.stamp.sec": header.stamp.sec, "header.stamp.nanosec": header.stamp.nanosec}


def by_length(texts: list[str]) -> Iterator[tuple[NDArray[np.int64], list[str]]]:
    """Texts grouped by their length in bytes, with their indices."""
    groups: dict[int, list[int]] = defaultdict(list)
    for index, text in enumerate(texts):
        groups[len(text.encode())].append(index)
    for indices in groups.values():
        yield np.array(indices), [texts[index] for index in indices]
