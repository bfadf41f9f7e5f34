"""Names of the peers: nodes whose bodies collide with the bodies of this node."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError

# Entry that stands for all nodes that are discovered.
AUTO = "auto"
TOPIC = "body_states"


def peer_names(entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of ``bodies.peers`` without duplicates. Raises `InputError` if an entry is no full node name,
    or if ``auto`` is not the only entry."""
    names = tuple(dict.fromkeys(entries))
    if AUTO in names and len(names) > 1:
        raise InputError("parameter", f"bodies.peers is {list(names)}; it must be 'auto' alone, or names")
    for name in names:
        try:
            validate_topic_name(name)
        except InvalidTopicNameException as error:
            raise InputError("parameter", f"bodies.peers has entry {name!r}: {error}") from None
        if name != AUTO and not name.startswith("/"):
            raise InputError("parameter", f"bodies.peers has entry {name!r}; a full name starts with '/'")
    return names


def topic_of(peer: str) -> str:
    """Return the topic of a node's body states."""
    return f"{peer}/{TOPIC}"
