"""Entries of parameters that name something: tracked bodies with their topics or frames, peer nodes, height scans."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import yaml
from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_full_topic_name import validate_full_topic_name
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.height_scan import HeightScan

# Entry of ``bodies.peers`` that stands for all nodes that are discovered.
AUTO = "auto"
_SETTINGS = [field.name for field in fields(HeightScan)]
_KEYS = ["body", "layout", "rate", *_SETTINGS]
# Bounds of a rate [Hz].
RATES = (0.01, 1000.0)


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
    entries = tuple(_entry(text, place) for place, text in enumerate(texts))
    topics = [entry.topic for entry in entries]
    for entry, topic in zip(entries, topics, strict=True):
        if topics.count(topic) > 1:
            raise InputError(
                "parameter", f"height_scans has two entries for {topic}, one of body {entry.body!r}; keep one of them"
            )
    return entries


def _entry(text: str, place: int) -> ScanEntry:
    try:
        return _scan_entry(yaml.safe_load(text), place)
    except InputError as error:
        raise InputError("parameter", f"height_scans has entry {text!r}: {error}") from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: of a date that is none
        raise InputError("parameter", f"height_scans has entry {text!r}, which is no YAML: {error}") from None


def _scan_entry(found: Any, place: int) -> ScanEntry:
    if not isinstance(found, dict) or not {"body"} <= found.keys() <= set(_KEYS):
        raise InputError("parameter", f"it must be a mapping with body and any of {_KEYS}")
    body, rate = str(found["body"]), found.get("rate", ScanEntry.rate)
    if type(found["body"]) not in (str, int) or not body or "/" in body:
        raise InputError("parameter", "the name of a body is a text, not empty, without '/'")
    if type(rate) not in (int, float) or not (math.isfinite(rate) and RATES[0] <= rate <= RATES[1]):
        raise InputError("parameter", f"rate must be {RATES[0]:g} to {RATES[1]:g} Hz")
    changes: dict[str, Any] = {"seed": place} | {name: found[name] for name in _SETTINGS if name in found}
    return ScanEntry(body, HeightScan.of(str(found.get("layout", "isaac_lab")), **changes), float(rate))
