"""Tracked bodies that parameters name, and the topics or frames of their poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError


class BodySource(NamedTuple):
    """A tracked body, and the topic or TF frame of its pose."""

    name: str
    source: str


def body_sources(entries: Mapping[str, Sequence[str]]) -> dict[str, tuple[BodySource, ...]]:
    """Return the sources that the entries of each parameter name.

    An entry is ``name=source``, or a source alone, which names the body, with ``.`` for ``/``. Raises `InputError` if a
    name is empty, contains ``/`` or repeats.
    """
    seen: set[str] = set()
    found: dict[str, tuple[BodySource, ...]] = {}
    for parameter, texts in entries.items():
        sources = [_source(parameter, text) for text in texts]
        for name, _ in sources:
            if name in seen:
                raise InputError(
                    "parameter", f"{parameter} names body {name!r} again; use name=source to give it another name"
                )
            seen.add(name)
        found[parameter] = tuple(sources)
    return found


def _source(parameter: str, text: str) -> BodySource:
    name, equals, source = text.partition("=")
    if not equals:
        name, source = text.strip("~/").replace("/", "."), text
    if not name or not source or "/" in name:
        raise InputError(
            "parameter", f"{parameter} has entry {text!r}; it must be name=source, with no '/' in the name"
        )
    if parameter != "bodies.frames":
        try:
            validate_topic_name(source)
        except InvalidTopicNameException as error:
            raise InputError("parameter", f"{parameter} has entry {text!r}: {error}") from None
    return BodySource(name, source)
