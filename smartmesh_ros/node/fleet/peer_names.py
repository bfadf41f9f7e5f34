"""Names of the nodes whose bodies meet those of this one."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError

# Instead of names: all that are found.
AUTO = "auto"
TOPIC = "body_states"


def peer_names(entries: Sequence[str]) -> tuple[str, ...]:
    """Return the entries of ``bodies.peers``, each once. Raises `InputError` where one is no full name of a node, or ``auto``
    is not alone."""
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
