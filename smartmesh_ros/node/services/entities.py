"""Bodies as entities of simulation_interfaces: those that pass an EntityFilters message, and their Bounds."""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import Body, bounds_of
from smartmesh_ros.world.world import World


def select(world: World, filters: Any, bounds: Any) -> list[str]:
    """Return the names of the bodies that pass all filters. ``bounds``: the message class Bounds, for its constants.

    The name filter is a Python regular expression, a superset of POSIX except for bracketed classes. The bounds filter
    uses the axis-aligned bounds of bodies. Raises `InputError` for filters by category or tag, which bodies lack.
    """
    if filters.categories or filters.tags.tags:
        raise InputError("unsupported", "entities have no categories and no tags here; leave those filters empty")
    try:
        pattern = re.compile(filters.filter)
    except re.error as error:
        raise InputError("filter", f"{filters.filter!r} is not a regular expression: {error}") from None
    names = [body.name for body in world.bodies.values() if not body.owner and pattern.search(body.name)]
    if filters.bounds.type == bounds.TYPE_EMPTY:
        return names
    points = np.array([(point.x, point.y, point.z) for point in filters.bounds.points])
    if filters.bounds.type not in (bounds.TYPE_BOX, bounds.TYPE_SPHERE):
        raise InputError("unsupported", f"bounds of type {filters.bounds.type} are not supported; use a box or sphere")
    if len(points) != 2 or not np.isfinite(points).all():
        raise InputError("geometry", "bounds must have two finite points: corners, or a centre and a radius")
    box = filters.bounds.type == bounds.TYPE_BOX
    low, high, reach = (points.min(axis=0), points.max(axis=0), 0.0) if box else (points[0], points[0], points[1, 0])
    return [name for name in names if _gap(world, name, low, high) <= reach]


def _gap(world: World, name: str, low: FloatArray, high: FloatArray) -> float:
    """Return the distance [m] of a body's bounds from a box with these corners (3,)."""
    body_low, body_high = bounds_of(world.client, world.bodies[name])
    return float(np.linalg.norm(np.maximum(np.maximum(body_low - high, low - body_high), 0.0)))


def own_bounds(body: Body) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner (3,) [m] of a body's box in its own frame; for a robot, all links at joint
    positions zero in the frame of the root link."""
    box = body.outline.body_shape.record
    half, centre = box["half"] + box["rounding"], box["offset"]
    position, orientation = body.inertial
    own = centre + half * np.array(list(product((-1.0, 1.0), repeat=3)))
    corners = [np.array(position) + rotate(orientation, (x, y, z)) for x, y, z in own]
    return np.min(corners, axis=0), np.max(corners, axis=0)
