"""Contact parameters that a URDF gives for its links."""

from __future__ import annotations

from xml.etree import ElementTree

_PARAMETERS = ("lateral_friction", "restitution")


def given_contacts(urdf: str) -> dict[str, frozenset[str]]:
    """Return which of ``lateral_friction`` and ``restitution`` the ``<contact>`` of each link gives, by link name, in a
    URDF text that is valid XML."""
    return {
        link.get("name", ""): frozenset(name for name in _PARAMETERS if link.find(f"contact/{name}") is not None)
        for link in ElementTree.fromstring(urdf).iterfind("link")
    }
