"""Entries of bodies to spawn: one YAML mapping for each body, as of the parameter ``bodies.spawn``.

``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [height, radius] or capsule [height, radius] in metres; or ``urdf`` with a file. ``xyz`` is the
position in the terrain's frame. With ``xy`` the body waits for the ground: with ``clearance`` its lowest point starts
that far above the ground, 0 by default, and with ``align: true`` it is tilted with the ground; with ``above`` instead
its centre starts that far above the ground. ``yaw`` [rad] is the turn about z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.parameters.entries import entries_of, finite, name_in, shape_in
from smartmesh_ros.world.robots.prepared import PreparedRobot

_PLACE = ("xyz", "xy", "above", "clearance", "align", "yaw")
_KEYS = ("shape", "size", "mass", "urdf", *_PLACE)


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


def entries_from(texts: Sequence[str]) -> dict[str, Entry]:
    """Return the entries of YAML mappings by their names. Raises `InputError`."""
    return {entry.name: entry for entry in entries_of("bodies.spawn", texts, _KEYS, _entry, owner="id")}


def start_from(texts: Sequence[str]) -> Entry:
    """Return the one entry of the parameter ``robot.start``, of a robot whose URDF comes later. Raises `InputError`."""

    def entry(found: dict[str, Any], place: int) -> Entry:
        return _entry({**found, "urdf": "of the description"}, place)

    starts = entries_of("robot.start", texts, _PLACE, entry, owner="id")
    if len(starts) != 1:
        raise InputError("parameter", f"robot.start has {len(starts)} entries; the robot starts at one place")
    return starts[0]


def _entry(found: dict[str, Any], _: int) -> Entry:
    """Return the entry of a mapping. Raises `InputError`."""
    urdf = str(found.get("urdf", ""))
    if urdf and (own := [key for key in ("shape", "size", "mass") if key in found]):
        raise InputError("parameter", f"a robot has the shapes and masses of its urdf; leave out {', '.join(own)}")
    shape = None if urdf else shape_in(found)
    mass, yaw = finite([found.get("mass", 1.0), found.get("yaw", 0.0)], 2, "mass and yaw must be finite numbers")
    place = _place(found)
    if not isinstance(found.get("align", False), bool):
        raise InputError("parameter", f"align is {found['align']!r}; it must be true or false")
    if {"clearance", "align"} & found.keys() and {"xyz", "above"} & found.keys():
        raise InputError("parameter", "clearance and align go with xy alone, not with xyz or above")
    return Entry(name_in(found, "id"), shape=shape, mass=mass, urdf=urdf, yaw=yaw, **place)


def _place(found: dict[str, Any]) -> dict[str, Any]:
    words = "it needs xyz: [x, y, z], or xy: [x, y] with clearance or above, all of them finite"
    key, count = ("xyz", 3) if "xyz" in found else ("xy", 2)
    place = finite(found.get(key), count, words)
    above, clearance = finite([found.get("above", 0.0), found.get("clearance", 0.0)], 2, words)
    known = {"above": above if "above" in found else None, "clearance": clearance, "align": found.get("align", False)}
    return {key: tuple(place), **known}
