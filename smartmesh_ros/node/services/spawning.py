"""Bodies of the parameter ``bodies.spawn``: one YAML mapping each.

``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [radius, height] or capsule [radius, height] in metres; or ``urdf`` with a file. ``xyz`` is the
position in the terrain's frame. With ``xy`` and ``above`` the centre starts that far above the ground, once the terrain
covers that place. ``yaw`` [rad] is the turn about z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.physics.state import BodyState, Vector
from smartmesh_ros.physics.world import World

_SHAPES: dict[str, type[Any]] = {"sphere": Sphere, "box": Box, "cylinder": Cylinder, "capsule": Capsule}
# The C parser takes a tenth of the time, which matters for a thousand bodies.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_KEYS = {"id", "shape", "size", "mass", "urdf", "xyz", "xy", "above", "yaw"}


@dataclass(frozen=True)
class Entry:
    """A body to spawn: a shape of ``mass`` [kg] or a URDF, at ``xyz`` [m], or ``above`` the ground at ``xy`` [m], with
    ``yaw`` [rad] about z."""

    name: str
    shape: Shape | None = None
    mass: float = 1.0
    urdf: str = ""
    xyz: Vector | None = None
    xy: tuple[float, float] = (0.0, 0.0)
    above: float = 0.0
    yaw: float = 0.0


def entry_from_text(text: str) -> Entry:
    """Return the entry of a YAML mapping. Raises `InputError` if the text is no valid entry."""
    try:
        entry = yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise InputError("spawn", f"bodies.spawn entry {text!r} is not YAML: {error}") from None
    if not isinstance(entry, dict) or not {"id"} <= entry.keys() <= _KEYS:
        raise InputError("spawn", f"bodies.spawn entry {text!r} must be a mapping with id and any of {sorted(_KEYS)}")
    urdf = str(entry.get("urdf", ""))
    try:
        return Entry(
            str(entry["id"]),
            shape=None if urdf else _shape(entry, text),
            mass=float(entry.get("mass", 1.0)),
            urdf=urdf,
            yaw=float(entry.get("yaw", 0.0)),
            **_place(entry, text),
        )
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("spawn", f"bodies.spawn entry {text!r}: mass and yaw must be numbers") from None


def spawn(world: World, entry: Entry) -> bool:
    """Spawn the body of an entry. Return False if the terrain does not cover its place yet. Raises `InputError` if the
    world refuses the body."""
    position = entry.xyz
    if position is None:
        x, y = entry.xy
        height = float(world.terrain.at([[x, y]], world.time).heights[0])
        if math.isnan(height):
            return False
        position = (x, y, height + entry.above)
    state = BodyState(position, (0.0, 0.0, math.sin(0.5 * entry.yaw), math.cos(0.5 * entry.yaw)))
    if entry.shape is None:
        world.spawn_robot(entry.name, entry.urdf, state)
    else:
        world.spawn(entry.name, entry.shape, entry.mass, state)
    return True


def _place(entry: dict[str, Any], text: str) -> dict[str, Any]:
    try:
        if "xyz" in entry:
            x, y, z = (float(value) for value in entry["xyz"])
            return {"xyz": (x, y, z)}
        x, y = (float(value) for value in entry["xy"])
        return {"xy": (x, y), "above": float(entry["above"])}
    except (KeyError, TypeError, ValueError):
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r} needs xyz: [x, y, z], or xy: [x, y] and above"
        ) from None


def _shape(entry: dict[str, Any], text: str) -> Shape:
    try:
        shape: Shape = _SHAPES[entry["shape"]](*(float(value) for value in entry["size"]))
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r} needs a shape ({', '.join(_SHAPES)}) and its size in metres"
        ) from None
    return shape
