"""Bodies of the parameter ``bodies.spawn``: one YAML mapping each.

``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [radius, height] or capsule [radius, height] in metres; or ``urdf`` with a file. ``xyz`` is the
position in the terrain's frame. With ``xy`` the body waits for the ground: with ``clearance`` its lowest point starts
that far above the ground, 0 by default, and with ``align: true`` it is tilted with the ground; with ``above`` instead
its centre starts that far above the ground. ``yaw`` [rad] is the turn about z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape
from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.world.robots.prepared import PreparedRobot
from smartmesh_ros.world.world import World

# The C parser takes a tenth of the time, which matters for a thousand bodies.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_KEYS = {"id", "shape", "size", "mass", "urdf", "xyz", "xy", "above", "clearance", "align", "yaw"}


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


def state_of(world: World, entry: Entry) -> BodyState | None:
    """Return the state of an entry, which the ground may lift; None if the terrain does not cover its place yet."""
    position = entry.xyz
    if position is None:
        x, y = entry.xy
        height = float(world.terrain.at([[x, y]], world.time).heights[0])
        if math.isnan(height):
            return None
        position = (x, y, height + (entry.above or 0.0))
    return BodyState(position, (0.0, 0.0, math.sin(0.5 * entry.yaw), math.cos(0.5 * entry.yaw)))


def spawn(world: World, entry: Entry) -> bool:
    """Spawn the body of an entry. Return False if the terrain does not cover its place yet. Raises `InputError` if the
    world refuses the body."""
    state = state_of(world, entry)
    if state is None:
        return False
    standing: dict[str, Any] = {"on_ground": entry.on_ground, "clearance": entry.clearance, "align": entry.align}
    if entry.shape is None:
        world.spawn_robot(entry.name, entry.robot or entry.urdf, state, **standing)
    else:
        world.spawn(entry.name, entry.shape, entry.mass, state, **standing)
    return True


def _place(entry: dict[str, Any], text: str) -> dict[str, Any]:
    try:
        if "xyz" in entry:
            x, y, z = (float(value) for value in entry["xyz"])
            wanted: dict[str, Any] = {"xyz": (x, y, z)}
        elif "above" in entry:
            x, y = (float(value) for value in entry["xy"])
            wanted = {"xy": (x, y), "above": float(entry["above"])}
        else:
            x, y = (float(value) for value in entry["xy"])
            clearance = float(entry.get("clearance", 0.0))
            return {"xy": (x, y), "clearance": clearance, "align": bool(entry.get("align", False))}
    except (KeyError, TypeError, ValueError):
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r} needs xyz: [x, y, z], or xy: [x, y] with clearance or above"
        ) from None
    if {"clearance", "align"} & entry.keys():
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r}: clearance and align go with xy alone, not with xyz or above"
        )
    return wanted


def _shape(entry: dict[str, Any], text: str) -> Shape:
    try:
        shape: Shape = SHAPES_BY_NAME[entry["shape"]](*(float(value) for value in entry["size"]))
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r} needs a shape ({', '.join(SHAPES_BY_NAME)}) and its size in metres"
        ) from None
    return shape
