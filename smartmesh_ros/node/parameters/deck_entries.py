"""The parameter ``decks``, a list of YAML mappings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.node.parameters.entries import entries_of

DeckSource = Literal["frame", "odometry", "body"]
_SOURCES: tuple[DeckSource, ...] = ("frame", "odometry", "body")
_KEYS = (*_SOURCES, "link", "thickness", "at", "rpy")


@dataclass(frozen=True)
class DeckEntry:
    """A deck, and what moves it: a TF frame, an odometry topic or a body, by its ``name``.

    ``link``: of a robot, "" = its base. ``thickness`` [m]: as of `Deck`. ``at`` [m], ``orientation`` (x, y, z, w): pose
    of the deck's frame in that of what moves it.
    """

    deck: str
    source: DeckSource
    name: str
    link: str = ""
    thickness: float = math.inf
    at: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)

    @property
    def frame(self) -> str:
        """The ``frame_id`` of maps in the deck's frame, beside the empty one."""
        return self.name if self.source == "frame" else self.deck


def deck_entries(parameter: str, texts: Sequence[str]) -> tuple[DeckEntry, ...]:
    """Return the entries of the parameter ``decks``.

    ``{deck: ferry, frame: ferry/deck, thickness: 0.5}``: the name of the ``deck``; one of ``frame`` (of TF),
    ``odometry`` (a topic) and ``body`` (simulated or tracked; of a robot with a ``link``); ``thickness`` [m]; ``at``
    [m] and ``rpy`` [rad], the pose of the deck's frame in that of what moves it. Raises `InputError` if a text is no
    valid entry, or two decks have one name.
    """
    return entries_of(parameter, texts, _KEYS, _deck_entry, owner="deck")


def _deck_entry(found: dict[str, Any], _: int) -> DeckEntry:
    sources = [source for source in _SOURCES if source in found]
    if len(sources) != 1:
        raise InputError("parameter", f"it must have one of {', '.join(_SOURCES)}, which moves the deck")
    names = {key: found[key] for key in ("deck", "link", *sources) if key in found}
    if not all(isinstance(name, str) and name for name in names.values()) or "/" in names["deck"]:
        raise InputError("parameter", "names are texts, not empty, that of a deck without '/'")
    if "link" in names and sources != ["body"]:
        raise InputError("parameter", "a link is that of a body")
    if sources == ["odometry"]:
        try:
            validate_topic_name(names["odometry"])
        except InvalidTopicNameException as error:
            raise InputError("parameter", str(error)) from None
    thickness = found.get("thickness", math.inf)
    if type(thickness) not in (int, float) or not thickness >= 0.0:
        raise InputError("parameter", "the thickness is a number of metres, zero or more")
    roll, pitch, yaw = _three(found.get("rpy", [0.0, 0.0, 0.0]), "rpy")
    turns: list[Quaternion] = [
        (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)), (0.0, math.sin(0.5 * pitch), 0.0, math.cos(0.5 * pitch)),
        (math.sin(0.5 * roll), 0.0, 0.0, math.cos(0.5 * roll)),
    ]  # fmt: skip
    orientation = product(product(turns[0], turns[1]), turns[2])
    at = _three(found.get("at", [0.0, 0.0, 0.0]), "at")
    source = sources[0]
    return DeckEntry(names["deck"], source, names[source], names.get("link", ""), float(thickness), at, orientation)


def _three(values: Any, what: str) -> Vector:
    if not isinstance(values, list) or [type(value) in (int, float) for value in values] != [True] * 3:
        raise InputError("parameter", f"{what} must be three numbers")
    x, y, z = (float(value) for value in values)
    if not math.isfinite(x + y + z):
        raise InputError("parameter", f"{what} must be three finite numbers")
    return x, y, z
