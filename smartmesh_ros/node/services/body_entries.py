"""Entries of bodies to spawn: one YAML mapping for each body, as of the parameter ``bodies.spawn``.

``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [height, radius] or capsule [height, radius] in metres; or ``urdf`` with a file. ``xyz`` is the
position in the terrain's frame. With ``xy`` the body waits for the ground: with ``clearance`` its lowest point starts
that far above the ground, 0 by default, and with ``align: true`` it is tilted with the ground; with ``above`` instead
its centre starts that far above the ground. ``yaw`` [rad] is the turn about z.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import yaml

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape, shape_from
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.world.robots.prepared import PreparedRobot

# The C parser takes a tenth of the time, which matters for a thousand bodies.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_BODY = {"shape", "size", "mass", "urdf"}
_KEYS = {"id", "xyz", "xy", "above", "clearance", "align", "yaw"} | _BODY


@dataclass(frozen=True)
class Entry:
    """A body to spawn: a shape of ``mass`` [kg] or a URDF, with ``yaw`` [rad] about z.

    It starts at ``xyz`` [m], or at ``xy`` [m]: its centre ``above`` [m] the ground, or its lowest point ``clearance``
    [m] above the ground and, with ``align``, tilted with it.
    """

    name: str
    shape: Shape | None = None
    mass: float = 1.0
    urdf: str = ""
    robot: PreparedRobot | None = None  # of ``urdf``
    xyz: Vector | None = None
    xy: tuple[float, float] = (0.0, 0.0)
    above: float | None = None
    clearance: float = 0.0
    align: bool = False
    yaw: float = 0.0

    @property
    def on_ground(self) -> bool:
        """True if the ground determines the height of the lowest point."""
        return self.xyz is None and self.above is None


def entry_from_text(text: str, urdf: str = "") -> Entry:
    """Return the entry of a YAML mapping, of a robot if its ``urdf`` is given. Raises `InputError` if the text is no
    valid entry."""
    what, keys = ("robot.start", _KEYS - _BODY) if urdf else ("bodies.spawn entry", _KEYS)
    try:
        entry = yaml.load(text, Loader=LOADER)
    except yaml.YAMLError as error:
        raise InputError("spawn", f"{what} {text!r} is not YAML: {error}") from None
    if not isinstance(entry, dict) or "id" not in entry:
        raise InputError("spawn", f"{what} {text!r} must be a mapping with id and any of {sorted(keys)}")
    for key in entry.keys() - keys:
        words = f"{key!r} is unknown{suggestion(str(key), keys)}; the keys are {', '.join(sorted(keys))}"
        raise InputError("spawn", f"{what} {text!r}: {words}")
    urdf = urdf or str(entry.get("urdf", ""))
    shape = None if urdf else _shape_of(entry, text)
    with _refused(text, ": mass and yaw must be numbers"):
        mass, yaw = float(entry.get("mass", 1.0)), float(entry.get("yaw", 0.0))
    with _refused(text, " needs xyz: [x, y, z], or xy: [x, y] with clearance or above"):
        place = _place(entry)
    if {"clearance", "align"} & entry.keys() and {"xyz", "above"} & entry.keys():
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r}: clearance and align go with xy alone, not with xyz or above"
        )
    return Entry(str(entry["id"]), shape=shape, mass=mass, urdf=urdf, yaw=yaw, **place)


def entries_from(texts: Iterable[str]) -> dict[str, Entry]:
    """Return the entries of YAML mappings by their names. Raises `InputError`."""
    entries: dict[str, Entry] = {}
    for text in texts:
        entry = entry_from_text(text)
        if entry.name in entries:
            raise InputError("spawn", f"bodies.spawn names {entry.name!r} twice; names must be distinct")
        entries[entry.name] = entry
    return entries


def _shape_of(entry: dict[str, Any], text: str) -> Shape:
    """Return the shape of an entry. Raises `InputError`."""
    known, name = ", ".join(SHAPES_BY_NAME), entry.get("shape")
    if name is None:
        raise InputError("spawn", f"bodies.spawn entry {text!r} needs a shape ({known}) and its size, or a urdf")
    if name not in [*SHAPES_BY_NAME]:
        words = f"there is no shape {name!r}{suggestion(str(name), SHAPES_BY_NAME)}; choose {known}"
        raise InputError("spawn", f"bodies.spawn entry {text!r}: {words}")
    with _refused(text, " needs the size of its shape in metres, such as size: [0.2]"):
        try:
            return shape_from(SHAPES_BY_NAME[name], entry["size"])
        except InputError as error:
            raise InputError("spawn", f"bodies.spawn entry {text!r}: {error}") from None


@contextmanager
def _refused(text: str, words: str) -> Iterator[None]:
    """Raise `InputError` with ``words`` about an entry's text if the block cannot convert it."""
    try:
        yield
    except InputError:
        raise
    except (KeyError, TypeError, ValueError):
        raise InputError("spawn", f"bodies.spawn entry {text!r}{words}") from None


def _place(entry: dict[str, Any]) -> dict[str, Any]:
    if "xyz" in entry:
        x, y, z = (float(value) for value in entry["xyz"])
        return {"xyz": (x, y, z)}
    x, y = (float(value) for value in entry["xy"])
    if "above" in entry:
        return {"xy": (x, y), "above": float(entry["above"])}
    clearance = float(entry.get("clearance", 0.0))
    return {"xy": (x, y), "clearance": clearance, "align": bool(entry.get("align", False))}
