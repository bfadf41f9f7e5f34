"""Hypothesis strategies for any message type: every field within what its type can hold."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosidl_parser.definition import AbstractSequence, AbstractString, Array, BasicType, NamespacedType

_NAMES = ("", "map", "odom", "a", "ball", "rover", "body_0", "robot", "robot/wheel", "x" * 300, "\u00e4\u6f22", "a\nb")


def messages(kind: Any) -> st.SearchStrategy[Any]:
    """Messages of a type."""
    fields = kind.get_fields_and_field_types()
    parts = {name: _values(slot) for name, slot in zip(fields, kind.SLOT_TYPES, strict=True)}
    return st.builds(kind, **parts)


def _values(slot: Any) -> st.SearchStrategy[Any]:
    if isinstance(slot, BasicType):
        return _numbers(slot.typename)
    if isinstance(slot, AbstractString):
        return st.sampled_from(_NAMES) | st.text(max_size=12, alphabet=st.characters(exclude_categories=["Cs"]))
    if isinstance(slot, NamespacedType):
        kind = getattr(import_module(".".join(slot.namespaces)), slot.name)
        if slot.name == "Quaternion":
            return st.just(kind(w=1.0)) | messages(kind)
        return messages(kind)
    if isinstance(slot, Array):
        return st.lists(_values(slot.value_type), min_size=slot.size, max_size=slot.size)
    assert isinstance(slot, AbstractSequence)
    return st.lists(_values(slot.value_type), max_size=4) | st.lists(_values(slot.value_type), min_size=9, max_size=9)


def _numbers(name: str) -> st.SearchStrategy[Any]:
    if name == "boolean":
        return st.booleans()
    if name in ("float", "double"):
        return st.floats(-20.0, 20.0, width=32) | st.floats(width=32 if name == "float" else 64)
    bounds = np.iinfo({"octet": "uint8", "char": "uint8"}.get(name, name))
    return st.integers(0, 4) | st.integers(int(bounds.min), int(bounds.max))
