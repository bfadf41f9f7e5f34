"""Height scans of the parameter ``height_scans``: one YAML mapping each.

``{body: robot, layout: isaac_lab, rate: 50, noise: 0.01}``: ``body``, the name of a body that is or will be there;
``layout``, one of `LAYOUTS`; ``rate`` [Hz] in simulated time; and any setting of `HeightScan`, which replaces the
layout's. Without a ``seed`` each entry has its place in the list.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.height_scan import HeightScan

_SETTINGS = [field.name for field in fields(HeightScan)]
_KEYS = ["body", "layout", "rate", *_SETTINGS]
# Bounds of a rate [Hz].
RATES = (0.01, 1000.0)


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
    """Return the entries of YAML mappings. Raises `InputError` if a text is no valid entry, or two have one topic."""
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
        found = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:  # ValueError: of a date that is none
        raise InputError("parameter", f"height_scans has entry {text!r}, which is no YAML: {error}") from None
    if not isinstance(found, dict) or not {"body"} <= found.keys() <= set(_KEYS):
        raise InputError(
            "parameter", f"height_scans has entry {text!r}; it must be a mapping with body and any of {_KEYS}"
        )
    body, rate = str(found["body"]), found.get("rate", ScanEntry.rate)
    if type(found["body"]) not in (str, int) or not body or "/" in body:
        raise InputError(
            "parameter", f"height_scans has entry {text!r}; the name of a body is a text, not empty, without '/'"
        )
    if type(rate) not in (int, float) or not (math.isfinite(rate) and RATES[0] <= rate <= RATES[1]):
        raise InputError("parameter", f"height_scans has entry {text!r}; rate must be {RATES[0]:g} to {RATES[1]:g} Hz")
    changes: dict[str, Any] = {"seed": place} | {name: found[name] for name in _SETTINGS if name in found}
    try:
        return ScanEntry(body, HeightScan.of(str(found.get("layout", "isaac_lab")), **changes), float(rate))
    except InputError as error:
        raise InputError("parameter", f"height_scans has entry {text!r}: {error}") from None
