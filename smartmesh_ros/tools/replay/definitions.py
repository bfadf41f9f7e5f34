"""Definitions of messages as text, and their hashes, as recordings hold them: from the installed files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from rosidl_parser.definition import AbstractNestedType, NamespacedType

from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.tools.replay.bag import type_of

SEPARATOR = "=" * 80
# The parts of a service's file, in order.
PARTS = ("Request", "Response")


def definition_of(kind: Any) -> str:
    """Return the definition of a message class, and those of all messages in it, each once, after lines of ``=`` and
    ``MSG: package/Name``. Requests, responses and events of services have those of their parts."""
    name, *others = dict.fromkeys(_names(kind))
    parts = [_text(name)]
    for other in others:
        package, _, message = other.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{message}\n{_text(other)}")
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


def hash_of(kind: Any) -> str:
    """Return the hash of a message class (REP 2011), empty if its package has none."""
    package, middle, message = type_of(kind).split("/")
    service, _, _ = message.partition("_")
    try:
        found = json.loads((_folder(package, middle) / f"{service}.json").read_text())["type_hashes"]
    except (OSError, KeyError, ValueError):
        return ""
    return next((str(one["hash_string"]) for one in found if one["type_name"] == type_of(kind)), "")


def _names(kind: Any) -> Iterator[str]:
    """Yield the name of a class and of the messages in it."""
    yield type_of(kind)
    for field in kind.SLOT_TYPES:
        inner = field.value_type if isinstance(field, AbstractNestedType) else field
        if isinstance(inner, NamespacedType):
            yield from _names(class_of("/".join(inner.namespaced_name())))


def _text(name: str) -> str:
    package, middle, message = name.split("/")
    if middle == "msg":
        return (_folder(package, middle) / f"{message}.msg").read_text()
    service, _, part = message.rpartition("_")
    if part in PARTS:
        return (_folder(package, middle) / f"{service}.srv").read_text().split("---\n")[PARTS.index(part)]
    fields = (f"{package}/{service}_{part}[<=1] {part.lower()}" for part in PARTS)
    return "\n".join(["service_msgs/ServiceEventInfo info", *fields])


def _folder(package: str, middle: str) -> Path:
    return Path(get_package_share_directory(package)) / middle
