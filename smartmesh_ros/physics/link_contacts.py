"""Contact parameters that a URDF gives for its links."""

from __future__ import annotations

import re

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_LINK = re.compile(
    r"<link\b[^>]*?\bname\s*=\s*([\"'])(?P<name>.*?)\1[^>]*?(?:/>|>(?P<content>.*?)</link\s*>)", re.DOTALL
)
_PARAMETER = re.compile(r"<(lateral_friction|restitution)\b")


def given_contacts(urdf: str) -> dict[str, frozenset[str]]:
    """Return which of ``lateral_friction`` and ``restitution`` the ``<contact>`` of each link gives, by link name.

    The text is searched, not parsed, because PyBullet also loads files that XML parsers refuse.
    """
    links = _LINK.finditer(_COMMENT.sub("", urdf))
    return {link["name"]: frozenset(_PARAMETER.findall(link["content"] or "")) for link in links}
