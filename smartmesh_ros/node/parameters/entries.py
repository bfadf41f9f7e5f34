"""Parameters that are lists of YAML mappings, one for each height scan, ground map, IMU or base."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Protocol, TypeVar

import yaml

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape, Solid, shape_from
from smartmesh_ros.terrain.height_scan import HeightScan
from smartmesh_ros.world.base_config import BaseConfig
from smartmesh_ros.world.imu import ImuConfig

# The C parser takes a tenth of the time, which matters for a thousand bodies.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# Bounds of a rate [Hz].
RATES = (0.01, 1000.0)


class Entry(Protocol):
    """An entry of a list in which each has a topic of its own."""

    @property
    def topic(self) -> str:
        """The private topic on which it is published, or the name of what it is about."""


EntryT = TypeVar("EntryT", bound=Entry)


@dataclass(frozen=True)
class ScanEntry:
    """A height scan around a ``body``, published ``rate`` times a second of simulated time [Hz]."""

    body: str
    scan: HeightScan
    rate: float = 50.0

    @property
    def topic(self) -> str:
        """The private topic."""
        return f"~/height_scan/{topic_name(self.body)}"


@dataclass(frozen=True)
class GroundMapEntry:
    """A grid map of the ground around a ``body``: its ``size`` along x and y [m], the ``spacing`` of its cells [m], and
    the ``rate`` at which it is published in simulated time [Hz]."""

    body: str
    size: tuple[float, float] = (10.0, 10.0)
    spacing: float = 0.1
    rate: float = 10.0

    @property
    def topic(self) -> str:
        """The private topic."""
        return f"~/ground_map/{topic_name(self.body)}"


@dataclass(frozen=True)
class ImuEntry:
    """An IMU of a ``body``, of a robot at its ``link``, "" = the root link."""

    body: str
    link: str = ""
    config: ImuConfig = field(default_factory=ImuConfig)

    @property
    def topic(self) -> str:
        """The private topic."""
        return "~/imu/" + "/".join(topic_name(name) for name in (self.body, self.link) if name)


@dataclass(frozen=True)
class BaseEntry:
    """A base: the robot ``body`` drives by ``config``. Its odometry is published ``rate`` times a second of simulated
    time [Hz], in the frame ``odom_frame``; with ``publish_tf`` the pose of the root link in it is on ``/tf``, too."""

    body: str
    config: BaseConfig
    rate: float = 50.0
    odom_frame: str = "odom"
    publish_tf: bool = False

    @property
    def name(self) -> str:
        """The last part of its topics."""
        return topic_name(self.body)

    @property
    def topic(self) -> str:
        """The private topic of the odometry."""
        return f"~/odom/{self.name}"


@dataclass(frozen=True)
class ShapeEntry:
    """What the tracked body ``body`` is: a ``solid``, or a robot by its ``urdf`` (file), whose root link's frame the
    pose of the body is."""

    body: str
    solid: Solid | None = None
    urdf: str = ""

    @property
    def topic(self) -> str:
        """The body, of which there is one entry."""
        return self.body


def topic_name(name: str) -> str:
    """Return a name as a part of a topic: characters that it cannot have become underscores, and one stands before a
    digit at the start."""
    name = re.sub("[^A-Za-z0-9_]", "_", name)
    return f"_{name}" if name[0].isdigit() else name


def scan_entries(texts: Sequence[str]) -> tuple[ScanEntry, ...]:
    """Return the entries of the parameter ``height_scans``.

    ``{body: robot, layout: isaac_lab, rate: 50, noise: 0.01}``: ``body``; ``layout``, one of `LAYOUTS`; ``rate`` [Hz]
    in simulated time; and any setting of `HeightScan`, which replaces the layout's. Without a ``seed`` each entry has
    its place in the list. Raises `InputError` if a text is no valid entry, or two have one topic.
    """

    def entry(found: dict[str, Any], place: int) -> ScanEntry:
        changes = {"seed": place} | {name: found[name] for name in _names_of(HeightScan) if name in found}
        return ScanEntry(_body(found), HeightScan.of(str(found.get("layout", "isaac_lab")), **changes), _rate(found))

    return entries_of("height_scans", texts, ("layout", "rate", *_names_of(HeightScan)), entry)


def ground_map_entries(texts: Sequence[str]) -> tuple[GroundMapEntry, ...]:
    """Return the entries of the parameter ``ground_maps``.

    ``{body: robot, size: [10, 10], spacing: 0.1, rate: 10}``: ``body``; ``size`` and ``spacing`` [m], as of a
    `HeightScan`; ``rate`` [Hz] in simulated time. Raises `InputError` as `scan_entries` does.
    """

    def entry(found: dict[str, Any], _: int) -> GroundMapEntry:
        usual = GroundMapEntry(_body(found))
        scan = HeightScan(size=found.get("size", usual.size), spacing=found.get("spacing", usual.spacing))
        return GroundMapEntry(usual.body, scan.size, scan.spacing, _rate(found, usual.rate))

    return entries_of("ground_maps", texts, ("size", "spacing", "rate"), entry)


def imu_entries(texts: Sequence[str]) -> tuple[ImuEntry, ...]:
    """Return the entries of the parameter ``imus``.

    ``{body: robot, link: imu_link, rate: 100, gyroscope_noise_density: 1e-4}``: ``body``; ``link``; and any setting of
    `ImuConfig`. Without a ``seed`` each entry has its place in the list. Raises `InputError` as `scan_entries` does.
    """

    def entry(found: dict[str, Any], place: int) -> ImuEntry:
        changes = {"seed": place} | {name: found[name] for name in _names_of(ImuConfig) if name in found}
        return ImuEntry(_body(found), _text(found, "link", ""), ImuConfig(**changes))

    return entries_of("imus", texts, ("link", *_names_of(ImuConfig)), entry)


def base_entries(texts: Sequence[str]) -> tuple[BaseEntry, ...]:
    """Return the entries of the parameter ``bases``.

    ``{body: robot, wheels: [left, right], rate: 50, publish_tf: true}``: ``body``; ``rate`` [Hz] in simulated time;
    ``odom_frame``; ``publish_tf``; and any setting of `BaseConfig`. Raises `InputError` as `scan_entries` does, and if
    two publish transforms in one frame.
    """

    def entry(found: dict[str, Any], _: int) -> BaseEntry:
        config = BaseConfig(**{name: found[name] for name in _names_of(BaseConfig) if name in found})
        frame, publish_tf = _text(found, "odom_frame", BaseEntry.odom_frame), found.get("publish_tf", False)
        if type(publish_tf) is not bool or not frame:
            raise InputError("parameter", "publish_tf must be true or false, and odom_frame a text, not empty")
        return BaseEntry(_body(found), config, _rate(found), frame, publish_tf)

    entries = entries_of("bases", texts, ("rate", "odom_frame", "publish_tf", *_names_of(BaseConfig)), entry)
    frames = [entry.odom_frame for entry in entries if entry.publish_tf]
    if len({*frames}) < len(frames):
        raise InputError("parameter", "bases has two entries with publish_tf in one frame; give each an odom_frame")
    return entries


def shape_entries(texts: Sequence[str]) -> tuple[ShapeEntry, ...]:
    """Return the entries of the parameter ``bodies.shapes``.

    ``{body: crate, shape: box, size: [1, 1, 0.5]}``, with the shapes and sizes of ``bodies.spawn``; or
    ``{body: rover, urdf: /path}``. Raises `InputError` as `scan_entries` does.
    """

    def entry(found: dict[str, Any], _: int) -> ShapeEntry:
        if ("urdf" in found) == ("shape" in found):
            raise InputError("parameter", "it needs a shape and its size, or a urdf")
        if "urdf" in found:
            return ShapeEntry(_body(found), urdf=_text(found, "urdf", ""))
        return ShapeEntry(_body(found), shape_in(found))

    return entries_of("bodies.shapes", texts, ("shape", "size", "urdf"), entry)


def shape_in(found: Mapping[str, Any]) -> Shape:
    """Return the shape of an entry, by its ``shape`` and ``size`` [m]. Raises `InputError`."""
    name, known = found.get("shape"), ", ".join(SHAPES_BY_NAME)
    if name is None:
        raise InputError("parameter", f"it needs a shape ({known}) and its size, or a urdf")
    if name not in [*SHAPES_BY_NAME]:
        words = f"there is no shape {name!r}{suggestion(str(name), SHAPES_BY_NAME)}; choose {known}"
        raise InputError("parameter", words)
    try:
        size = [float(value) for value in found["size"]]
    except (KeyError, TypeError, ValueError):
        raise InputError("parameter", "size must be a list of numbers in metres, such as [0.2]") from None
    return shape_from(SHAPES_BY_NAME[name], size)


def entries_of(
    parameter: str,
    texts: Sequence[str],
    keys: Iterable[str],
    make: Callable[[dict[str, Any], int], EntryT],
    owner: str = "body",
) -> tuple[EntryT, ...]:
    """Return the entry that ``make`` makes of each text and its place, a mapping with ``owner`` and any of ``keys``."""
    entries: dict[str, EntryT] = {}
    for place, text in enumerate(texts):
        try:
            found = yaml.load(text, Loader=LOADER)
            if not isinstance(found, dict) or not {owner} <= found.keys() <= {owner, *keys}:
                unknown = found.keys() - {owner, *keys} if isinstance(found, dict) else ()
                hints = [f"; {key!r} is unknown{suggestion(str(key), keys)}" for key in unknown]
                words = f"it must be a mapping with {owner} and any of {[*keys]}{''.join(hints)}"
                raise InputError("parameter", words)
            entry = make(found, place)
        except InputError as error:
            raise InputError("parameter", f"{parameter} has entry {text!r}: {error}") from None
        except (yaml.YAMLError, ValueError) as error:  # ValueError: of a date that is none
            raise InputError("parameter", f"{parameter} has entry {text!r}, which is no YAML: {error}") from None
        if entries.setdefault(entry.topic, entry) is not entry:
            which = f"{entry.topic}, one of {owner} {str(found[owner])!r}"
            raise InputError("parameter", f"{parameter} has two entries for {which}; keep one of them")
    return tuple(entries.values())


def _names_of(config: type[Any]) -> list[str]:
    return [one.name for one in fields(config)]


def _body(found: dict[str, Any]) -> str:
    body = found["body"]
    if type(body) not in (str, int) or not str(body) or "/" in str(body):
        raise InputError("parameter", "the name of a body is a text, not empty, without '/'")
    return str(body)


def _text(found: dict[str, Any], key: str, default: str) -> str:
    value = found.get(key, default)
    if type(value) not in (str, int):
        raise InputError("parameter", f"{key} must be a text")
    return str(value)


def _rate(found: dict[str, Any], usual: float = 50.0) -> float:
    rate = found.get("rate", usual)
    if type(rate) not in (int, float) or not (math.isfinite(rate) and RATES[0] <= rate <= RATES[1]):
        raise InputError("parameter", f"rate must be {RATES[0]:g} to {RATES[1]:g} Hz")
    return float(rate)
