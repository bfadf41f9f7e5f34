"""Messages from bytes that nobody vouches for.

The middleware drops a malformed message without a word, and decodes a long one whole before anybody can object. So
topics are read as bytes, and checked and counted here.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from rclpy.serialization import deserialize_message
from rosidl_parser.definition import AbstractSequence, AbstractString, Array, BasicType, NamespacedType

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader

# Elements that a sequence of messages or strings may have, where nothing else is said.
MOST_ITEMS = 100_000

_SIZES = {
    "boolean": 1, "octet": 1, "char": 1, "uint8": 1, "int8": 1, "uint16": 2, "int16": 2, "uint32": 4, "int32": 4,
    "uint64": 8, "int64": 8, "float": 4, "double": 8,
}  # fmt: skip


def message_from(data: bytes, kind: Any, most: int = MOST_ITEMS) -> Any:
    """The message of type ``kind`` in its CDR bytes. Raises `InputError` where the bytes are no such message, or one of
    its sequences of messages or strings has more than ``most`` elements; no memory is taken before that is known."""
    reader = CdrReader(data)
    _check_message(reader, kind, most)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001  # rclpy raises what its decoder does, without a common base
        raise InputError("malformed", f"{len(data)} bytes are no {kind.__name__}: {error}") from None


def _check_message(reader: CdrReader, kind: Any, most: int) -> None:
    """Moves on through a message as far as there may be sequences whose elements need objects, and checks each."""
    types = kind.SLOT_TYPES
    last = max((index for index, slot in enumerate(types) if _counts_objects(slot)), default=-1)
    for index, slot in enumerate(types[: last + 1]):
        _check(reader, slot, most, to_end=index < last)


def _check(reader: CdrReader, slot: Any, most: int, *, to_end: bool) -> None:
    """Checks a field; moves on to its end only if something after it needs to be checked."""
    if isinstance(slot, NamespacedType):
        if to_end:
            _pass_over(reader, slot, most)
        else:
            _check_message(reader, _class_of(tuple(slot.namespaces), slot.name), most)
    elif isinstance(slot, AbstractSequence) and not isinstance(slot.value_type, BasicType):
        count = reader.count(_smallest(slot.value_type))
        if count > most:
            raise InputError("size", f"{count} elements in one sequence are more than the {most} allowed")
        if to_end or _counts_objects(slot.value_type):
            for _ in range(count):
                _pass_over(reader, slot.value_type, most)
    elif to_end:
        _pass_over(reader, slot, most)


def _pass_over(reader: CdrReader, slot: Any, most: int) -> None:
    """Moves on to the end of a field, checking the sequences in it."""
    if isinstance(slot, BasicType):
        reader.skip(_SIZES[slot.typename])
    elif isinstance(slot, AbstractString):
        reader.skip(1, reader.count(1))
    elif isinstance(slot, NamespacedType):
        for inner in _class_of(tuple(slot.namespaces), slot.name).SLOT_TYPES:
            _pass_over(reader, inner, most)
    elif isinstance(slot, Array):
        for _ in range(slot.size):
            _pass_over(reader, slot.value_type, most)
    elif isinstance(slot.value_type, BasicType):
        size = _SIZES[slot.value_type.typename]
        reader.skip(size, reader.count(size))
    else:
        _check(reader, slot, most, to_end=True)


def _counts_objects(slot: Any) -> bool:
    """Whether there is a sequence of messages or strings in a field."""
    if isinstance(slot, NamespacedType):
        return _message_counts_objects(_class_of(tuple(slot.namespaces), slot.name))
    if isinstance(slot, AbstractSequence):
        return not isinstance(slot.value_type, BasicType)
    return isinstance(slot, Array) and _counts_objects(slot.value_type)


@cache
def _message_counts_objects(kind: Any) -> bool:
    return any(_counts_objects(slot) for slot in kind.SLOT_TYPES)


def _smallest(slot: Any) -> int:
    """Fewest bytes that a field takes, without alignment."""
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
