"""Parameters that are lists of YAML mappings: height scans, ground maps, IMUs, bases, tracked shapes and decks."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Literal, NamedTuple, TypeVar

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from smartmesh_ros.errors import InputError, require_body_name, suggestion
from smartmesh_ros.ground.quaternions import X, Y, Z, about, product
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape, Solid, shape_from
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.parameters.declaring import Spec, checked_value
from smartmesh_ros.terrain.height_scan import HeightScan
from smartmesh_ros.world.base_config import BaseConfig
from smartmesh_ros.world.imu import ImuConfig
from smartmesh_ros.yaml_text import parsed_yaml

# Bounds of a rate [Hz].
RATES = (0.01, 1000.0)
EntryT = TypeVar("EntryT")


@dataclass(frozen=True, kw_only=True)
class OutputEntry:
    """What is published about a ``body`` on the private ``topic``: a height scan or a ground map (``config``: a
    `HeightScan`), an IMU (`ImuConfig`), or the odometry of a base that drives (`BaseConfig`).

    ``rate`` [Hz], in simulated time; that of an IMU is in its config. ``link``: of the robot that has the IMU, "" = the
    root link. ``odom_frame``: of a base, in which its odometry is; with ``publish_tf`` the pose of the root link in it
    is on ``/tf``, too.
    """

    body: str
    topic: str
    config: Any
    rate: float = 0.0
    link: str = ""
    odom_frame: str = ""
    publish_tf: bool = False


def require_topic(name: str, validate: Callable[[str], Any] = validate_topic_name) -> None:
    """Raise `InputError` unless a name can be that of a topic."""
    try:
        validate(name)
    except InvalidTopicNameException as error:
        raise InputError("parameter", str(error)) from None


class _Kind(NamedTuple):
    """Entries of one parameter: the ``name`` of their topics; what makes the config of the ``settings``; and the
    ``others`` of their keys, with the defaults."""

    name: str
    make: Callable[..., Any]
    settings: Sequence[str]
    others: dict[str, Any]


def _names_of(config: type[Any]) -> list[str]:
    return [one.name for one in fields(config)]


def _scan(layout: Any = "isaac_lab", **changes: Any) -> HeightScan:
    return HeightScan.of(str(layout), **changes)


_KINDS = {
    "height_scans": _Kind("height_scan", _scan, ("layout", *_names_of(HeightScan)), {"rate": 50.0}),
    "ground_maps": _Kind("ground_map", partial(HeightScan, size=(10.0, 10.0)), ("size", "spacing"), {"rate": 10.0}),
    "imus": _Kind("imu", ImuConfig, _names_of(ImuConfig), {"link": ""}),
    "bases": _Kind(
        "odom", BaseConfig, _names_of(BaseConfig), {"rate": 50.0, "odom_frame": "odom", "publish_tf": False}
    ),
}


def topic_name(name: str) -> str:
    """Return a name as a part of a topic: characters that it cannot have become underscores, and one stands before a
    digit at the start."""
    name = re.sub("[^A-Za-z0-9_]", "_", name)
    return f"_{name}" if name[0].isdigit() else name


def output_entries(parameter: str, texts: Sequence[str]) -> tuple[OutputEntry, ...]:
    """Return the entries of ``height_scans``, ``ground_maps``, ``imus`` or ``bases``.

    ``{body: robot, rate: 50, noise: 0.01}``: ``body``; the other fields of an `OutputEntry` that the parameter has; and
    any setting of its config, of a height scan also the ``layout``. Without a ``seed`` each entry has its place in the
    list. Raises `InputError` if a text is no valid entry, two have one topic, or two bases publish transforms in one
    frame.
    """
    kind = _KINDS[parameter]

    def entry(found: dict[str, Any], place: int) -> OutputEntry:
        body = name_in(found)
        others = {key: _checked(key, found.get(key, usual), usual) for key, usual in kind.others.items()}
        seed = {"seed": place} if "seed" in kind.settings else {}
        config = kind.make(**seed | {key: found[key] for key in kind.settings if key in found})
        path = "/".join(topic_name(name) for name in (body, others.get("link", "")) if name)
        return OutputEntry(body=body, topic=f"~/{kind.name}/{path}", config=config, **others)

    entries = entries_of(parameter, texts, (*kind.others, *kind.settings), entry)
    frames = [entry.odom_frame for entry in entries if entry.publish_tf]
    if len({*frames}) < len(frames):
        words = "two entries with publish_tf in one frame; give each an odom_frame"
        raise InputError("parameter", f"{parameter} has {words}")
    return entries


def _checked(key: str, value: Any, usual: Any) -> Any:
    """Return the value of a key with this default, checked as one of a parameter is; a text may be a number, and is
    empty only if the default is."""
    text = isinstance(usual, str) and type(value) is int
    checked = checked_value(Spec(key, usual, "", *RATES), str(value) if text else value)
    if usual and checked == "":
        raise InputError("parameter", f"{key} must not be empty")
    return checked


class ShapeEntry(NamedTuple):
    """What the tracked body ``body`` is: a ``solid``, or a robot by its ``urdf`` (file), whose root link's frame the
    pose of the body is."""

    body: str
    solid: Solid | None = None
    urdf: str = ""


def shape_entries(parameter: str, texts: Sequence[str]) -> tuple[ShapeEntry, ...]:
    """Return the entries of the parameter ``bodies.shapes``.

    ``{body: crate, shape: box, size: [1, 1, 0.5]}``, with the shapes and sizes of ``bodies.spawn``; or
    ``{body: rover, urdf: /path}``. Raises `InputError` as `output_entries` does.
    """

    def entry(found: dict[str, Any], _: int) -> ShapeEntry:
        if ("urdf" in found) == bool({"shape", "size"} & found.keys()):
            raise InputError("parameter", "it needs a shape and its size, or a urdf")
        if "urdf" in found:
            return ShapeEntry(name_in(found), urdf=_checked("urdf", found["urdf"], ""))
        return ShapeEntry(name_in(found), shape_in(found))

    return entries_of(parameter, texts, ("shape", "size", "urdf"), entry)


DeckSource = Literal["frame", "odometry", "body"]
_SOURCES: tuple[DeckSource, ...] = ("frame", "odometry", "body")
_KEYS = (*_SOURCES, "link", "thickness", "at", "rpy")


@dataclass(frozen=True)
class DeckEntry:
    """A deck, and what moves it: a TF frame, an odometry topic or a body, by its ``name``.

    ``link``: of a robot, "" = its base. ``thickness`` [m]: as of `Deck`. ``pose``: of the deck's frame in that of what
    moves it.
    """

    deck: str
    source: DeckSource
    name: str
    link: str
    thickness: float
    pose: Transform

    @property
    def frame(self) -> str:
        """The ``frame_id`` of maps in the deck's frame, beside the empty one."""
        return self.name.strip("/") if self.source == "frame" else self.deck


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
        require_topic(names["odometry"])
    thickness = found.get("thickness", math.inf)
    if type(thickness) not in (int, float) or not thickness > 0.0:
        raise InputError("parameter", "the thickness is a number of metres above zero")
    roll, pitch, yaw = finite(found.get("rpy", [0.0, 0.0, 0.0]), 3, "rpy must be three finite numbers")
    orientation = product(product(about(Z, yaw), about(Y, pitch)), about(X, roll))
    x, y, z = finite(found.get("at", [0.0, 0.0, 0.0]), 3, "at must be three finite numbers")
    source, link = sources[0], names.get("link", "")
    return DeckEntry(names["deck"], source, names[source], link, float(thickness), Transform((x, y, z), orientation))


def finite(values: Any, count: int, words: str) -> list[float]:
    """Return so many finite numbers; raises `InputError` with ``words`` if they are none."""
    with suppress(TypeError, ValueError, OverflowError):
        numbers = [math.nan if isinstance(value, bool) else float(value) for value in values]
        if isinstance(values, list) and len(numbers) == count and all(map(math.isfinite, numbers)):
            return numbers
    raise InputError("parameter", words)


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
    """Return the entry that ``make`` makes of each text and its place, a mapping with ``owner`` and any of ``keys``.
    Raises `InputError` if two have one owner, or one topic if they have topics."""
    entries: dict[str, EntryT] = {}
    for place, text in enumerate(texts):
        try:
            found = parsed_yaml(text)
            if not isinstance(found, dict) or not {owner} <= found.keys() <= {owner, *keys}:
                unknown = found.keys() - {owner, *keys} if isinstance(found, dict) else ()
                hints = [f"; {key!r} is unknown{suggestion(str(key), keys)}" for key in unknown]
                words = f"it must be a mapping with {owner} and any of {[*keys]}{''.join(hints)}"
                raise InputError("parameter", words)
            entry = make(found, place)
        except (ValueError, OverflowError) as error:  # `InputError`, or numbers without bounds
            raise InputError("parameter", f"{parameter} has entry {text!r}: {error}") from None
        name = getattr(entry, "topic", str(found[owner]))
        if entries.setdefault(name, entry) is not entry:
            which = f"{name}, one of {owner} {str(found[owner])!r}"
            raise InputError("parameter", f"{parameter} has two entries for {which}; keep one of them")
    return tuple(entries.values())


def name_in(found: dict[str, Any], owner: str = "body") -> str:
    """Return the name of a body in a mapping; digits may be a number. Raises `InputError`."""
    body = str(found[owner]) if type(found[owner]) is int else found[owner]
    require_body_name(body)
    return str(body)
