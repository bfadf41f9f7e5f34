"""Pure functions that convert messages to values of the core. Invalid messages raise `InputError`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from shape_msgs.msg import SolidPrimitive

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.ground.state import QUATERNION_SLACK, BodyState
from smartmesh_ros.node.inputs.cdr_reader import CdrReader, Stamped
from smartmesh_ros.terrain.grid import GridGeometry

FloatGrid = NDArray[np.float32]


class MapInput(NamedTuple):
    """A whole map: geometry (None = remove the tile), heights (rows, columns) [m], velocities [m/s] or None, and
    coefficients of friction: one, those of the samples, or None."""

    start: Stamped
    geometry: GridGeometry | None
    heights: FloatGrid
    velocities: FloatGrid | None
    friction: float | FloatGrid | None = None


class RegionInput(NamedTuple):
    """New heights (rows, columns) [m] of a rectangle, its first row and column, and velocities [m/s] or None."""

    start: Stamped
    row: int
    column: int
    heights: FloatGrid
    velocities: FloatGrid | None


class MeshInput(NamedTuple):
    """A general mesh: vertices (V, 3) [m], triangles (T, 3), and velocities (V, 3) [m/s] or None."""

    start: Stamped
    vertices: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    velocities: NDArray[np.float64] | None


class MeshUpdateInput(NamedTuple):
    """New positions (n, 3) [m] of the vertices ``indices`` (n,), None = all; and velocities (n, 3) [m/s] or None."""

    start: Stamped
    indices: NDArray[np.uint32] | None
    vertices: NDArray[np.float64]
    velocities: NDArray[np.float64] | None


class BodyInput(NamedTuple):
    """A tracked body: its name, state and bounding radius [m], 0 = the default. ``stated``: the state's velocity is
    stated even if it is zero."""

    name: str
    state: BodyState
    radius: float
    stated: bool = False


def stamp_seconds(stamp: Any) -> float | None:
    """Return a stamp in seconds; None if it is not set (zero)."""
    if stamp.sec < 0 or not 0 <= stamp.nanosec < 1_000_000_000:
        raise InputError("stamp", f"stamp {stamp.sec} s {stamp.nanosec} ns is not a time; nanosec is 0 to 999999999")
    if stamp.sec == 0 and stamp.nanosec == 0:
        return None
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def map_from(data: bytes, max_samples: int) -> MapInput:
    """Read a Heightmap message. Checks sizes before any allocation; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    reader.number("i"), reader.number("I")  # map_load_time
    resolution, columns, rows = reader.number("f"), reader.number("I"), reader.number("I")
    x, y, z, *orientation = reader.numbers("d", 7)
    heights, velocities, friction = (reader.sequence("f4") for _ in range(3))
    if not rows and not columns and not len(heights):
        return MapInput(start, None, heights, None)
    _require_count(columns, rows, len(heights), len(velocities), max_samples)
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(x, y, z),
                            yaw=yaw_from(*orientation))  # fmt: skip
    return MapInput(
        start, geometry, *_grids(heights, velocities, (rows, columns)), _friction(friction, (rows, columns))
    )


def region_from(data: bytes, max_samples: int) -> RegionInput:
    """Read a HeightmapUpdate message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    column, row, columns, rows = (reader.number("I") for _ in range(4))
    heights, velocities = reader.sequence("f4"), reader.sequence("f4")
    _require_count(columns, rows, len(heights), len(velocities), max_samples)
    return RegionInput(start, row, column, *_grids(heights, velocities, (rows, columns)))


def mesh_from(data: bytes, max_samples: int) -> MeshInput:
    """Read a TerrainMesh message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    triangles = reader.sequence("u4", 3)
    vertices = reader.sequence("f8", 3)
    velocities = reader.sequence("f8", 3)
    require_cells(len(vertices), max_samples)
    return MeshInput(start, vertices, triangles, velocities if len(velocities) else None)


def mesh_update_from(data: bytes, max_samples: int) -> MeshUpdateInput:
    """Read a TerrainMeshUpdate message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    indices = reader.sequence("u4")
    vertices = reader.sequence("f8", 3)
    velocities = reader.sequence("f8", 3)
    require_cells(len(vertices), max_samples)
    return MeshUpdateInput(start, indices if len(indices) else None, vertices, velocities if len(velocities) else None)


def bodies_from(message: Any) -> list[BodyInput]:
    """Convert a TrackedBodyArray message; one invalid body refuses the whole message."""
    bodies = []
    for body in message.bodies:
        if not (math.isfinite(body.radius) and body.radius >= 0.0):
            raise InputError("geometry", f"radius of {body.id!r} is {body.radius} m; it must be zero or more")
        bodies.append(BodyInput(body.id, state_from(body.pose, body.twist), float(body.radius)))
    _require_distinct([body.name for body in bodies])
    return bodies


def poses_from(message: Any) -> list[BodyInput]:
    """Convert a PoseArray message; body i gets the name ``body_<i>``."""
    return [BodyInput(f"body_{index}", state_from(pose), 0.0) for index, pose in enumerate(message.poses)]


def odometry_from(message: Any) -> BodyState:
    """Convert an Odometry message, its twist rotated from the body's frame into the frame of the pose."""
    state = state_from(message.pose.pose, message.twist.twist)
    linear, angular = (rotate(state.orientation, vector) for vector in (state.linear, state.angular))
    return replace(state, linear=linear, angular=angular)


def state_from(pose: Any, twist: Any = None) -> BodyState:
    """Convert a pose and a twist. `BodyState` checks that they are finite, and normalises the quaternion."""
    p, q = pose.position, pose.orientation
    linear = angular = (0.0, 0.0, 0.0)
    if twist is not None:
        linear = (twist.linear.x, twist.linear.y, twist.linear.z)
        angular = (twist.angular.x, twist.angular.y, twist.angular.z)
    return BodyState((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), linear, angular)


def yaw_from(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about z [rad] of a unit quaternion that rotates about no other axis."""
    length = math.hypot(x, y, z, w)
    if not math.isfinite(length) or abs(length - 1.0) > QUATERNION_SLACK:
        raise InputError("quaternion", f"the map's orientation ({x}, {y}, {z}, {w}) is not a unit quaternion")
    if math.hypot(x, y) > QUATERNION_SLACK:
        raise InputError("quaternion", f"the map is tilted (x = {x}, y = {y}); it may be rotated about z only")
    return 2.0 * math.atan2(z, w)


# Shapes by the types of SolidPrimitive, and which of its dimensions are theirs, in order.
SOLIDS: dict[int, tuple[type[Shape], tuple[int, ...]]] = {
    SolidPrimitive.SPHERE: (Sphere, (SolidPrimitive.SPHERE_RADIUS,)),
    SolidPrimitive.BOX: (Box, (SolidPrimitive.BOX_X, SolidPrimitive.BOX_Y, SolidPrimitive.BOX_Z)),
    SolidPrimitive.CYLINDER: (Cylinder, (SolidPrimitive.CYLINDER_RADIUS, SolidPrimitive.CYLINDER_HEIGHT)),
}


def shape_from(primitive: Any) -> Shape:
    """Convert a SolidPrimitive to a shape of the core."""
    dimensions = [float(value) for value in primitive.dimensions]
    if primitive.type not in SOLIDS:
        raise InputError("shape", f"shape type {primitive.type} is not supported; use SPHERE, BOX or CYLINDER")
    made, order = SOLIDS[primitive.type]
    if len(dimensions) != len(order):
        name = made.__name__.upper()
        raise InputError("shape", f"{name} needs {len(order)} dimensions, not {len(dimensions)}")
    return made(*(dimensions[index] for index in order))


def _grids(heights: Any, velocities: Any, shape: tuple[int, int]) -> tuple[FloatGrid, FloatGrid | None]:
    """Return flat arrays as views (rows, columns)."""
    return heights.reshape(shape), velocities.reshape(shape) if len(velocities) else None


def _friction(values: Any, shape: tuple[int, int]) -> float | FloatGrid | None:
    """Return flat coefficients as one number, a view (rows, columns), or None if there are none."""
    if len(values) == 1:
        return 1.0 if math.isnan(values[0]) else float(values[0])
    count = shape[0] * shape[1]
    if len(values) not in (0, count):
        what = f"{len(values)} coefficients of friction for {count} heights"
        raise InputError("length", f"{what}; there must be as many, or one, or none")
    return np.asarray(values.reshape(shape)) if len(values) else None


def _require_count(width: int, height: int, heights: int, velocities: int, max_samples: int) -> None:
    count = width * height
    require_cells(count, max_samples)
    if heights != count:
        raise InputError("length", f"{heights} heights for {height} rows x {width} columns; there must be {count}")
    if velocities not in (0, count):
        raise InputError("length", f"{velocities} velocities for {count} heights; there must be as many, or none")


def require_cells(count: int, max_samples: int) -> None:
    """Raise `InputError` if there are more samples than allowed. Called before memory is allocated."""
    if count > max_samples:
        raise InputError("size", f"{count} samples are more than terrain.max_samples = {max_samples}")


def require_resolution(resolution: float) -> None:
    """Raise `InputError` if a resolution [m] is not possible."""
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise InputError("geometry", f"resolution is {resolution} m; it must be finite and greater than zero")


def require_length(what: str, actual: int, wanted: int) -> None:
    """Raise `InputError` if the length of the data does not match the sizes."""
    if actual != wanted:
        raise InputError("length", f"{what} has {actual} values; its sizes say {wanted}")


def _require_distinct(names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if not name or "/" in name:
            raise InputError("empty_id", f"{name!r} cannot name a body; a name is not empty and has no '/'")
        if name in seen:
            raise InputError("duplicate_id", f"body {name!r} is in the message twice; names must be distinct")
        seen.add(name)
