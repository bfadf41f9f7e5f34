"""Decoding of any message from untrusted CDR bytes after a check."""

from __future__ import annotations

from functools import cache
from typing import Any

from rclpy.serialization import deserialize_message
from rosidl_parser.definition import AbstractNestedType, AbstractString, Array, BasicType, NamespacedType

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.outputs.cdr import DTYPES

# Most elements in a sequence of messages or strings.
MOST_ITEMS = 100_000


def message_from(data: bytes, kind: Any) -> Any:
    """Decode a message of type ``kind`` from its bytes.

    Raises `InputError` if the bytes are no such message, or if a sequence of messages or strings has more than
    `MOST_ITEMS` elements, which is checked before anything is allocated.
    """
    _check(CdrReader(data), _fields_to_check(kind), last=True)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001  # the decoder's errors have no common base
        raise InputError("malformed", f"{len(data)} bytes are no {kind.__name__}: {error}") from None


def _check(reader: CdrReader, fields: list[Any], *, last: bool) -> None:
    """Skip fields, checking the sequences in them. ``last``: no check follows, so the last one need not be skipped."""
    for left, field in zip(range(len(fields) - 1, -1, -1), fields, strict=True):
        final = last and not left
        if isinstance(field, BasicType):
            reader.skip(DTYPES[field.typename].itemsize)
        elif isinstance(field, AbstractString):
            reader.skip(1, reader.count(1))
        elif isinstance(field, NamespacedType):
            kind = _class_of(*field.namespaced_name())
            _check(reader, _fields_to_check(kind) if final else kind.SLOT_TYPES, last=final)
        else:
            items = field.value_type
            count = field.size if isinstance(field, Array) else reader.count(1)
            if isinstance(items, BasicType):
                reader.skip(DTYPES[items.typename].itemsize, count)
            elif count > MOST_ITEMS:
                raise InputError("size", f"{count} elements in one sequence are more than the {MOST_ITEMS} allowed")
            elif not final or _needs_check(items):
                _check(reader, [items] * count, last=False)


def _needs_check(field: Any) -> bool:
    """Return True if a field is or contains a sequence of messages or strings."""
    if isinstance(field, NamespacedType):
        return bool(_fields_to_check(_class_of(*field.namespaced_name())))
    return isinstance(field, AbstractNestedType) and not isinstance(field.value_type, BasicType)


@cache
def _fields_to_check(kind: Any) -> list[Any]:
    """Return the types of a message's fields up to the last one that needs a check."""
    fields = list(kind.SLOT_TYPES)
    while fields and not _needs_check(fields[-1]):
        fields.pop()
    return fields


@cache
def _class_of(*name: str) -> Any:
    return class_of("/".join(name))
