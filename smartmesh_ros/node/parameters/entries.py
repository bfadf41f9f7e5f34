"""Entries of the parameters that are lists of YAML mappings: height scans and decks."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Literal, TypeVar

import yaml
from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.terrain.height_scan import HeightScan

EntryT = TypeVar("EntryT")

_SCAN_SETTINGS = [one.name for one in fields(HeightScan)]
_KEYS = ["body", "layout", "rate", *_SCAN_SETTINGS]
# Bounds of a rate [Hz].
RATES = (0.01, 1000.0)


def parsed(parameter: str, text: str, make: Callable[[Any], EntryT]) -> EntryT:
    """Return what ``make`` makes of an entry's YAML; raises `InputError` that names the parameter and the entry."""
    try:
        return make(yaml.safe_load(text))
    except InputError as error:
        raise InputError("parameter", f"{parameter} has entry {text!r}: {error}") from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: of a date that is none
        raise InputError("parameter", f"{parameter} has entry {text!r}, which is no YAML: {error}") from None


@dataclass(frozen=True)
class ScanEntry:
    """A height scan around a ``body``, published ``rate`` times a second of simulated time [Hz]."""

    body: str
    scan: HeightScan
    rate: float = 50.0

    @property
    def topic(self) -> str:
        """The private topic. Characters of the body's name that a topic cannot have become underscores, and one stands
        before a digit at the start."""
        name = re.sub("[^A-Za-z0-9_]", "_", self.body)
        return f"~/height_scan/{'_' if name[0].isdigit() else ''}{name}"


def scan_entries(texts: Sequence[str]) -> tuple[ScanEntry, ...]:
    """Return the entries of YAML mappings of the parameter ``height_scans``.

    ``{body: robot, layout: isaac_lab, rate: 50, noise: 0.01}``: ``body``, the name of a body that is or will be there;
    ``layout``, one of `LAYOUTS`; ``rate`` [Hz] in simulated time; and any setting of `HeightScan`, which replaces the
    layout's. Without a ``seed`` each entry has its place in the list. Raises `InputError` if a text is no valid entry,
    or two have one topic.
    """
    entries: dict[str, ScanEntry] = {}
    for place, text in enumerate(texts):
        entry = parsed("height_scans", text, partial(_scan_entry, place))
        if entries.setdefault(entry.topic, entry) is not entry:
            raise InputError(
                "parameter",
                f"height_scans has two entries for {entry.topic}, one of body {entry.body!r}; keep one of them",
            )
    return tuple(entries.values())


def _scan_entry(place: int, found: Any) -> ScanEntry:
    if not isinstance(found, dict) or not {"body"} <= found.keys() <= set(_KEYS):
        raise InputError("parameter", f"it must be a mapping with body and any of {_KEYS}")
    body, rate = str(found["body"]), found.get("rate", ScanEntry.rate)
    if type(found["body"]) not in (str, int) or not body or "/" in body:
        raise InputError("parameter", "the name of a body is a text, not empty, without '/'")
    if type(rate) not in (int, float) or not (math.isfinite(rate) and RATES[0] <= rate <= RATES[1]):
        raise InputError("parameter", f"rate must be {RATES[0]:g} to {RATES[1]:g} Hz")
    changes: dict[str, Any] = {"seed": place} | {name: found[name] for name in _SCAN_SETTINGS if name in found}
    return ScanEntry(body, HeightScan.of(str(found.get("layout", "isaac_lab")), **changes), float(rate))


DeckSource = Literal["frame", "odometry", "body"]
_SOURCES: tuple[DeckSource, ...] = ("frame", "odometry", "body")
_DECK_KEYS = ["deck", *_SOURCES, "link", "thickness", "at", "rpy"]


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


def deck_entries(texts: Sequence[str]) -> tuple[DeckEntry, ...]:
    """Return the entries of YAML mappings of the parameter ``decks``.

    ``{deck: ferry, frame: ferry/deck, thickness: 0.5}``: the name of the ``deck``; one of ``frame`` (of TF),
    ``odometry`` (a topic) and ``body`` (simulated or tracked; of a robot with a ``link``); ``thickness`` [m]; ``at``
    [m] and ``rpy`` [rad], the pose of the deck's frame in that of what moves it. Raises `InputError` if a text is no
    valid entry, or two decks have one name.
    """
    entries: dict[str, DeckEntry] = {}
    for text in texts:
        entry = parsed("decks", text, _deck_entry)
        if entries.setdefault(entry.deck, entry) is not entry:
            raise InputError("parameter", f"decks has two entries for {entry.deck!r}; keep one of them")
    return tuple(entries.values())


def _deck_entry(found: Any) -> DeckEntry:
    if not isinstance(found, dict) or not {"deck"} <= found.keys() <= set(_DECK_KEYS):
        raise InputError("parameter", f"it must be a mapping with deck and any of {_DECK_KEYS}")
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
