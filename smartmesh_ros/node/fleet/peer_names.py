"""Names of the peers: nodes whose bodies collide with the bodies of this node."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_full_topic_name import validate_full_topic_name

from smartmesh_ros.errors import InputError

# Entry that stands for all nodes that are discovered.
AUTO = "auto"
TOPIC = "body_states"


def peer_names(entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of ``bodies.peers`` without duplicates. Raises `InputError` if an entry is no full node name,
    or if ``auto`` is not the only entry."""
    if AUTO in entries:
        if set(entries) != {AUTO}:
            raise InputError("parameter", f"bodies.peers is {list(entries)}; it must be 'auto' alone, or names")
        return (AUTO,)
    return full_names("bodies.peers", entries)


def full_names(parameter: str, entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of a parameter without duplicates. Raises `InputError` if an entry is no full node name."""
    names = tuple(dict.fromkeys(entries))
    for name in names:
        if not name.startswith("/"):
            raise InputError("parameter", f"{parameter} has entry {name!r}; a full name starts with '/'")
        try:
            validate_full_topic_name(name)
        except InvalidTopicNameException as error:
            raise InputError("parameter", f"{parameter} has entry {name!r}: {error}") from None
    return names


def topic_of(peer: str) -> str:
    """Return the topic of a node's body states."""
    return f"{peer}/{TOPIC}"
