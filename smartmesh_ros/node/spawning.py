"""Bodies named by parameter: one YAML mapping each.

``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [radius, height] or capsule [radius, height] in metres; or ``urdf`` with a file. ``xyz``
places it in the terrain's frame; ``xy`` and ``above`` place its centre above the ground as soon as there is ground.
``yaw`` [rad] turns it.
"""

from __future__ import annotations

import math
from typing import Any

import yaml

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.physics.world import World

_SHAPES: dict[str, type[Any]] = {"sphere": Sphere, "box": Box, "cylinder": Cylinder, "capsule": Capsule}
# The C parser takes a tenth of the time, which counts where a thousand bodies are named.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_KEYS = {"id", "shape", "size", "mass", "urdf", "xyz", "xy", "above", "yaw"}


def spawn_from_text(world: World, text: str) -> bool:
    """Spawns the body of a YAML mapping; False if it waits for ground. Raises `InputError` if it cannot be."""
    try:
        entry = yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise InputError("spawn", f"bodies.spawn entry {text!r} is not YAML: {error}") from None
    if not isinstance(entry, dict) or not {"id"} <= entry.keys() <= _KEYS:
        raise InputError("spawn", f"bodies.spawn entry {text!r} must be a mapping with id and any of {sorted(_KEYS)}")
    position = _position(world, entry, text)
    if position is None:
        return False
    half = 0.5 * float(entry.get("yaw", 0.0))
    state = BodyState(position, (0.0, 0.0, math.sin(half), math.cos(half)))
    if "urdf" in entry:
        world.spawn_robot(str(entry["id"]), str(entry["urdf"]), state)
    else:
        world.spawn(str(entry["id"]), _shape(entry, text), float(entry.get("mass", 1.0)), state)
    return True


def _position(world: World, entry: dict[str, Any], text: str) -> tuple[float, float, float] | None:
    try:
        if "xyz" in entry:
            x, y, z = (float(value) for value in entry["xyz"])
            return x, y, z
        x, y = (float(value) for value in entry["xy"])
        above = float(entry["above"])
    except (KeyError, TypeError, ValueError):
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r} needs xyz: [x, y, z], or xy: [x, y] and above"
        ) from None
    height = float(world.terrain.at([[x, y]], world.time).heights[0])
    return None if math.isnan(height) else (x, y, height + above)


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
