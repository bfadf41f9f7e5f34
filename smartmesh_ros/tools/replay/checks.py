"""Names and types that a test gives to a replay, and what would be right in place of wrong ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.tools.replay.bag import EVENTS, Topic, type_of
from smartmesh_ros.tools.replay.transport import Service


def require_named(node: str, what: str, names: Collection[str], known: Collection[str]) -> None:
    """Raise `InputError` if one of the full ``names`` is no ``what`` of the ``node``, whose ones are the ``known``."""
    if unknown := sorted(set(names) - set(known)):
        word, *words = (name.removeprefix(f"{node}/") for name in (unknown[0], *sorted(known)))
        hint = suggestion(word, words) or f"; it has {', '.join(words)}"
        raise InputError("name", f"{node} has no {what} {word}{hint}")


def require_type(name: str, message: Any, *kinds: type) -> None:
    """Raise `InputError` if a message for ``name`` is of none of these kinds, the first of which the error names."""
    if not isinstance(message, kinds):
        raise InputError("type", f"{name} takes {type_of(kinds[0])}, and was given a {type(message).__name__}")


def require_taken(
    node: str, left: Mapping[str, Topic], inputs: Collection[str], services: Mapping[str, Service]
) -> None:
    """Raise `InputError` if topics of a list of messages are ``left``, which no input and no service takes."""
    names = {topic.removesuffix(EVENTS): topic for topic in sorted(left)}
    require_named(node, "input or service", names, {*inputs, *services})
    for name, topic in names.items():
        right = type_of(services[name].kind.Request)
        raise InputError("type", f"{name} is a service: it takes {right}, and was given a {left[topic].type_name}")
