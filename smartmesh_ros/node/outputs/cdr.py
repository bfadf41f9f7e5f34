"""Messages as ready CDR bytes, many equal elements at a time.

Filling a thousand markers object by object takes rclpy about 100 ms; writing the same bytes column by column takes less
than one. `Elements` lays out any number of equal elements of a message's last sequence - equal in the lengths of their
strings and sequences - from the message definitions, as NumPy records over one buffer.

Byte order is little-endian whatever the machine, as the header of the stream says. Alignment follows plain CDR (XCDR1):
every number lies at a multiple of its own size from the end of the 4-byte header.
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
LONGEST = 8  # the largest alignment of any type [bytes]

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
    """A number, or an array of numbers of one type, within an element: dotted path, place and value."""

    path: str
    offset: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    value: Any


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size


class _Walk:
    """Walks a message instance and notes where each of its numbers lies."""

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
        # Equal numbers all through (points, triangles) become one array; anything else is walked item by item.
        dtype = _dtype_throughout(values[0], kind)
        if dtype is not None:
            known: dict[int, NDArray[Any]] = {}
            for value in values:
                if id(value) not in known:  # templates repeat one object
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
    """The one type of all numbers in a value of fixed size; None where there are several, or text or a sequence."""
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
    """The numbers of a value that `_dtype_throughout` has found to be of one type."""
    walk = _Walk(0)
    walk.field(value, kind, "")
    return np.concatenate([np.ravel(leaf.value) for leaf in walk.leaves])


class _Row(NamedTuple):
    """One element that starts at a phase: its bytes, its fields as a record, and where the next may start."""

    template: NDArray[np.uint8]
    record: np.dtype[Any]
    end: int


class Elements:
    """Layout of equal elements of a sequence, from a template element with the wanted lengths and constant values."""

    def __init__(self, template: Any) -> None:
        self._template = template
        self._rows: dict[int, _Row] = {}
        self._alignment: int = self._row(0).record[0].base.itemsize

    def _row(self, phase: int) -> _Row:
        """The template as bytes, when it starts ``phase`` bytes after a multiple of the longest alignment."""
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
        """Writes ``count`` elements at ``offset`` of ``buffer`` and returns where the next byte goes.

        ``fields``: values of the fields that differ from the template, by path, one row per element; a single number is
        taken for all. Strings are (count, bytes) arrays without their closing zero, as `text_rows` makes them.
        ``same``: that as many elements with the same fields were the last thing written there, so that only the values
        of the fields need writing.
        """
        if count == 0:
            return offset
        # Elements need not be a multiple of the alignment long: after a few of them their layout repeats.
        starts = [_aligned(offset, self._alignment)]
        phases = [starts[0] % LONGEST]
        while (start := self._next_start(starts[-1])) % LONGEST not in phases:
            starts.append(start)
            phases.append(start % LONGEST)
        lead = phases.index(start % LONGEST)  # elements before the repeating ones
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
        """Writes the ``chosen`` elements, whose layout is the same, from ``first`` on, one every ``period`` bytes."""
        row = self._row(first % LONGEST)
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
                target = target[:, : np.shape(value)[1]]  # all but a string's closing zero
            target[...] = part
        return first + (count - 1) * period + size

    def size_bound(self, count: int) -> int:
        """Bytes that ``count`` elements take at the most."""
        return count * (len(self._row(0).template) + 2 * LONGEST)

    def _next_start(self, start: int) -> int:
        """Where the element after the one at ``start`` starts: aligned as its first field is."""
        return _aligned(start - start % LONGEST + self._row(start % LONGEST).end, self._alignment)


def text_rows(texts: list[str]) -> NDArray[np.uint8]:
    """Texts of equal length in bytes as an array (n, bytes) for `Elements.put`."""
    data = [text.encode() for text in texts]
    return np.frombuffer(b"".join(data), np.uint8).reshape(len(data), -1)
