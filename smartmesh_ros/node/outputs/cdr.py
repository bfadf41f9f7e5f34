"""Serialisation of messages with many equal elements to CDR bytes.

Filling a thousand markers object by object takes rclpy about 100 ms; writing the same bytes column by column takes less
than 1 ms. `Elements` lays out the equal elements of a message's last sequence as NumPy records in one buffer, from the
message definitions. Elements are equal if their strings and sequences have equal lengths.

The byte order is always little-endian, as the stream's header states. Alignment follows plain CDR (XCDR1): the offset
of a number from the end of the 4-byte header is a multiple of the number's size.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosidl_parser.definition import (
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)

# Encapsulation: little-endian CDR, no options.
HEADER = b"\x00\x01\x00\x00"
MAX_ALIGNMENT = 8  # the largest alignment of any type [bytes]

_FORMATS = {
    "boolean": "<u1",
    "octet": "<u1",
    "char": "<u1",
    "uint8": "<u1",
    "int8": "<i1",
    "uint16": "<u2",
    "int16": "<i2",
    "uint32": "<u4",
    "int32": "<i4",
    "uint64": "<u8",
    "int64": "<i8",
    "float": "<f4",
    "double": "<f8",
}


class Leaf(NamedTuple):
    """A number, or an array of numbers of one type, in an element: dotted path, offset [bytes] and value."""

    path: str
    offset: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    value: Any


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size


class _Walk:
    """Walks a message instance and records the offset of each number."""

    def __init__(self, phase: int) -> None:
        self.offset = phase
        self.leaves: list[Leaf] = []

    def message(self, message: Any, path: str) -> None:
        for name, kind in zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True):
            self.field(getattr(message, name), kind, f"{path}.{name}" if path else name)

    def field(self, value: Any, kind: Any, path: str) -> None:
        if isinstance(kind, BasicType):
            self.numbers(path, np.dtype(_FORMATS[kind.typename]), (), value)
        elif isinstance(kind, AbstractString):
            data = np.frombuffer(value.encode() + b"\0", np.uint8)
            self.numbers(f"{path}.size", np.dtype("<u4"), (), len(data))
            self.numbers(path, np.dtype("<u1"), data.shape, data)
        elif isinstance(kind, NamespacedType):
            self.message(value, path)
        elif isinstance(kind, AbstractSequence):
            self.numbers(f"{path}.size", np.dtype("<u4"), (), len(value))
            self.items(value, kind.value_type, path)
        elif isinstance(kind, Array):
            self.items(value, kind.value_type, path)
        else:
            raise TypeError(f"{path}: {kind} has no fixed layout")

    def items(self, values: Any, kind: Any, path: str) -> None:
        if len(values) == 0:
            return
        if isinstance(kind, BasicType):
            array = np.asarray(values)
            self.numbers(path, np.dtype(_FORMATS[kind.typename]), array.shape, array)
            return
        # Items whose numbers all have one type (points, triangles) become one array; others are walked one by one.
        dtype = _dtype_throughout(values[0], kind)
        if dtype is not None:
            known: dict[int, NDArray[Any]] = {}
            for value in values:
                if id(value) not in known:  # templates repeat the same object
                    known[id(value)] = _flat(value, kind)
            flat = np.stack([known[id(value)] for value in values])
            self.numbers(path, dtype, flat.shape, flat)
            return
        for index, value in enumerate(values):
            self.field(value, kind, f"{path}[{index}]")

    def numbers(self, path: str, dtype: np.dtype[Any], shape: tuple[int, ...], value: Any) -> None:
        self.offset = _aligned(self.offset, dtype.itemsize)
        self.leaves.append(Leaf(path, self.offset, dtype, shape, value))
        self.offset += dtype.itemsize * math.prod(shape)


def _dtype_throughout(value: Any, kind: Any) -> np.dtype[Any] | None:
    """Return the common type of all numbers in a value; None if they differ, or if it has strings or sequences."""
    if isinstance(kind, BasicType):
        return np.dtype(_FORMATS[kind.typename])
    if isinstance(kind, Array):
        return _dtype_throughout(value[0], kind.value_type)
    if not isinstance(kind, NamespacedType):
        return None
    fields = zip(value.get_fields_and_field_types(), value.SLOT_TYPES, strict=True)
    dtypes = {_dtype_throughout(getattr(value, name), inner) for name, inner in fields}
    return dtypes.pop() if len(dtypes) == 1 else None


def _flat(value: Any, kind: Any) -> NDArray[Any]:
    """Return the numbers of a value in a flat array; `_dtype_throughout` must have found a common type."""
    walk = _Walk(0)
    walk.field(value, kind, "")
    return np.concatenate([np.ravel(leaf.value) for leaf in walk.leaves])


class _Row(NamedTuple):
    """An element that starts at a given phase: bytes, record of its fields, and phase of its end."""

    template: NDArray[np.uint8]
    record: np.dtype[Any]
    end: int


class Elements:
    """Layout of equal elements of a sequence. The template element defines all lengths and the constant values."""

    def __init__(self, template: Any) -> None:
        self._template = template
        self._rows: dict[int, _Row] = {}
        self._alignment: int = self._row(0).record[0].base.itemsize

    def _row(self, phase: int) -> _Row:
        """Return the template for a start ``phase`` bytes after a multiple of `MAX_ALIGNMENT`."""
        if phase not in self._rows:
            walk = _Walk(phase)
            walk.message(self._template, "")
            data = np.zeros(walk.offset - phase, np.uint8)
            record = np.dtype(
                {
                    "names": [leaf.path for leaf in walk.leaves],
                    "formats": [(leaf.dtype, leaf.shape) for leaf in walk.leaves],
                    "offsets": [leaf.offset - phase for leaf in walk.leaves],
                    "itemsize": len(data),
                }
            )
            view = data.view(record)
            for leaf in walk.leaves:
                view[leaf.path] = leaf.value
            self._rows[phase] = _Row(data, record, walk.offset)
        return self._rows[phase]

    def put(
        self, buffer: NDArray[np.uint8], offset: int, count: int, fields: dict[str, Any], *, same: bool = False
    ) -> int:
        """Writes ``count`` elements at ``offset`` of ``buffer`` and returns the offset of the next byte.

        ``fields``: path -> values that replace the template's, one row per element, or one number for all elements.
        Strings are (count, bytes) arrays without terminating zero, see `text_rows`. ``same``: promises that the last
        call for this place had the same ``count`` and the same paths in ``fields``; only their values are then written.
        """
        if count == 0:
            return offset
        # The size of an element may be no multiple of the alignment, but the layout repeats after a few elements.
        starts = [_aligned(offset, self._alignment)]
        phases = [starts[0] % MAX_ALIGNMENT]
        while (start := self._next_start(starts[-1])) % MAX_ALIGNMENT not in phases:
            starts.append(start)
            phases.append(start % MAX_ALIGNMENT)
        lead = phases.index(start % MAX_ALIGNMENT)  # elements before the repeating ones
        cycle = len(starts) - lead
        period = start - starts[lead]
        end = offset
        for index, first in enumerate(starts[:count]):
            step = cycle if index >= lead else count
            end = max(end, self._put_rows(buffer, first, period, fields, slice(index, count, step), same))
        return end

    def _put_rows(
        self, buffer: NDArray[np.uint8], first: int, period: int, fields: dict[str, Any], chosen: slice, same: bool
    ) -> int:
        """Writes the ``chosen`` elements, which share a layout, from ``first`` on at intervals of ``period`` bytes."""
        row = self._row(first % MAX_ALIGNMENT)
        count = len(range(chosen.start, chosen.stop, chosen.step))
        size = len(row.template)
        if not same:
            block = np.ndarray((count, size), np.uint8, buffer, first, (period, 1))
            block[...] = row.template
        view: Any = np.ndarray((count,), row.record, buffer, first, (period,))
        for path, value in fields.items():
            part = value[chosen] if np.ndim(value) else value
            target = view[path]
            if f"{path}.size" in (row.record.names or ()) and target.dtype == np.uint8:
                target = target[:, : np.shape(value)[1]]  # all but a string's terminating zero
            target[...] = part
        return first + (count - 1) * period + size

    def size_bound(self, count: int) -> int:
        """Return an upper bound of the size of ``count`` elements [bytes]."""
        return count * (len(self._row(0).template) + 2 * MAX_ALIGNMENT)

    def _next_start(self, start: int) -> int:
        """Return the start of the element after the one at ``start``, aligned for its first field."""
        return _aligned(start - start % MAX_ALIGNMENT + self._row(start % MAX_ALIGNMENT).end, self._alignment)


def text_rows(texts: list[str]) -> NDArray[np.uint8]:
    """Return texts of equal length in bytes as an array (n, bytes) for `Elements.put`."""
    data = [text.encode() for text in texts]
    return np.frombuffer(b"".join(data), np.uint8).reshape(len(data), -1)
