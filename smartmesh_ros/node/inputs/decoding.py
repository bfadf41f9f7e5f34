"""Decoding of messages from untrusted bytes.

The middleware drops malformed messages silently, and decodes oversized ones before a callback can refuse them. So the
node subscribes to raw bytes, and checks them here before decoding.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from rclpy.serialization import deserialize_message
from rosidl_parser.definition import AbstractSequence, AbstractString, Array, BasicType, NamespacedType

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader

# Default of the most elements in a sequence of messages or strings.
MOST_ITEMS = 100_000

_SIZES = {
    "boolean": 1, "octet": 1, "char": 1, "uint8": 1, "int8": 1, "uint16": 2, "int16": 2, "uint32": 4, "int32": 4,
    "uint64": 8, "int64": 8, "float": 4, "double": 8,
}  # fmt: skip


def message_from(data: bytes, kind: Any, most: int = MOST_ITEMS) -> Any:
    """Decode a message of type ``kind`` from its CDR bytes.

    Raises `InputError` if the bytes are no such message, or if a sequence of messages or strings has more than ``most``
    elements, which is checked before anything is allocated.
    """
    reader = CdrReader(data)
    _check_message(reader, kind, most)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001  # the decoder's errors have no common base
        raise InputError("malformed", f"{len(data)} bytes are no {kind.__name__}: {error}") from None


def _check_message(reader: CdrReader, kind: Any, most: int) -> None:
    """Check every sequence of messages or strings in a message, reading up to the last one."""
    types = kind.SLOT_TYPES
    last = max((index for index, slot in enumerate(types) if _has_object_sequence(slot)), default=-1)
    for index, slot in enumerate(types[: last + 1]):
        _check(reader, slot, most, to_end=index < last)


def _check(reader: CdrReader, slot: Any, most: int, *, to_end: bool) -> None:
    """Check the sequences in a field. ``to_end``: read to the field's end, because a later field needs a check."""
    if isinstance(slot, NamespacedType):
        if to_end:
            _skip_field(reader, slot, most)
        else:
            _check_message(reader, _class_of(tuple(slot.namespaces), slot.name), most)
    elif isinstance(slot, AbstractSequence) and not isinstance(slot.value_type, BasicType):
        count = reader.count(_smallest(slot.value_type))
        if count > most:
            raise InputError("size", f"{count} elements in one sequence are more than the {most} allowed")
        if to_end or _has_object_sequence(slot.value_type):
            for _ in range(count):
                _skip_field(reader, slot.value_type, most)
    elif to_end:
        _skip_field(reader, slot, most)


def _skip_field(reader: CdrReader, slot: Any, most: int) -> None:
    """Skip a field, checking the sequences in it."""
    if isinstance(slot, BasicType):
        reader.skip(_SIZES[slot.typename])
    elif isinstance(slot, AbstractString):
        reader.skip(1, reader.count(1))
    elif isinstance(slot, NamespacedType):
        for inner in _class_of(tuple(slot.namespaces), slot.name).SLOT_TYPES:
            _skip_field(reader, inner, most)
    elif isinstance(slot, Array):
        for _ in range(slot.size):
            _skip_field(reader, slot.value_type, most)
    elif isinstance(slot.value_type, BasicType):
        size = _SIZES[slot.value_type.typename]
        reader.skip(size, reader.count(size))
    else:
        _check(reader, slot, most, to_end=True)


def _has_object_sequence(slot: Any) -> bool:
    """Return True if a field contains a sequence of messages or strings."""
    if isinstance(slot, NamespacedType):
        return _message_has_object_sequence(_class_of(tuple(slot.namespaces), slot.name))
    if isinstance(slot, AbstractSequence):
        return not isinstance(slot.value_type, BasicType)
    return isinstance(slot, Array) and _has_object_sequence(slot.value_type)


@cache
def _message_has_object_sequence(kind: Any) -> bool:
    return any(_has_object_sequence(slot) for slot in kind.SLOT_TYPES)


def _smallest(slot: Any) -> int:
    """Return the smallest size of a field, without alignment [bytes]."""
    if isinstance(slot, BasicType):
        return _SIZES[slot.typename]
    if isinstance(slot, NamespacedType):
        return _smallest_message(_class_of(tuple(slot.namespaces), slot.name))
    if isinstance(slot, Array):
        return int(slot.size) * _smallest(slot.value_type)
    return 4  # the count of a string or sequence


@cache
def _smallest_message(kind: Any) -> int:
    return max(1, sum(_smallest(slot) for slot in kind.SLOT_TYPES))


@cache
def _class_of(namespaces: tuple[str, ...], name: str) -> Any:
    return getattr(import_module(".".join(namespaces)), name)
