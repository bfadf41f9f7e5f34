"""Reading of messages from untrusted CDR bytes: those with terrain, arrays without a copy, and any other after a check.

The middleware drops malformed messages silently, and decodes oversized ones before a callback can refuse them. So the
node subscribes to raw bytes, and checks them here before decoding.
"""

from __future__ import annotations

import math
import struct
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from rosidl_parser.definition import AbstractNestedType, AbstractString, Array, BasicType, NamespacedType

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import QUATERNION_SLACK
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.outputs.cdr import DTYPES
from smartmesh_ros.terrain.grid import GridGeometry

FloatGrid = NDArray[np.float32]


class Stamped(NamedTuple):
    """The first fields of every terrain message: stamp (seconds and nanoseconds), frame and tile."""

    sec: int
    nanosec: int
    frame_id: str
    tile: str


class CdrReader:
    """Reads fields in the order of the message definition. Raises `InputError` if the bytes end too soon.

    ``at``: number of bytes read after the 4-byte header.
    """

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise InputError("malformed", f"{len(data)} bytes that do not start as plain CDR")
        self._order = "<" if data[1] else ">"
        self._data = memoryview(data)[4:]
        self.at = 0

    def number(self, code: str) -> Any:
        """Read one number, given its `struct` code."""
        return self.numbers(code, 1)[0]

    def numbers(self, code: str, count: int) -> tuple[Any, ...]:
        """Read ``count`` consecutive numbers, given their `struct` code."""
        return struct.unpack(f"{self._order}{count}{code}", self.skip(struct.calcsize(code), count))

    def text(self) -> str:
        """Read a string."""
        data = bytes(self.skip(1, self.number("I"))).rstrip(b"\0")
        if b"\0" in data:  # C code would read a shorter name than this one
            raise InputError("malformed", f"a string of {len(data)} bytes has a zero byte in it")
        try:
            return data.decode()
        except UnicodeDecodeError:
            raise InputError("malformed", f"a string of {len(data)} bytes is not UTF-8") from None

    def count(self, size: int) -> int:
        """Read the length of a sequence; the bytes left must hold so many elements of at least ``size`` bytes each."""
        count = int(self.number("I"))
        if count * size > len(self._data) - self.at:
            raise InputError("malformed", f"{count} elements from byte {self.at} of {len(self._data)} on")
        return count

    def sequence(self, dtype: str, width: int = 1) -> NDArray[Any]:
        """Read a sequence of numbers, or of ``width`` numbers each, as a view (n,) or (n, width) of the bytes."""
        kind = np.dtype(self._order + dtype)
        array = np.frombuffer(self.skip(kind.itemsize, self.number("I") * width), kind)
        return array if width == 1 else array.reshape(-1, width)

    def stamped(self) -> Stamped:
        """Read header and tile."""
        return Stamped(self.number("i"), self.number("I"), self.text(), self.text())

    def skip(self, size: int, count: int = 1) -> memoryview:
        """Skip ``count`` numbers of ``size`` bytes each, and return their bytes."""
        if not count:  # no alignment either
            return self._data[:0]
        start = -(-self.at // size) * size
        end = start + size * count
        if end > len(self._data):
            raise InputError("malformed", f"the message ends after {len(self._data)} bytes; a field needs {end}")
        self.at = end
        return self._data[start:end]


class MapInput(NamedTuple):
    """A whole map: geometry (None = remove the tile), heights (rows, columns) [m], velocities [m/s] or None;
    coefficients of friction: one, those of the samples, or None; and places of soils (rows, columns) or None."""

    start: Stamped
    geometry: GridGeometry | None
    heights: FloatGrid
    velocities: FloatGrid | None
    friction: float | FloatGrid | None = None
    soil: NDArray[np.uint8] | None = None

    @property
    def raster(self) -> Raster | None:
        """The map as a raster; None = remove the tile."""
        if self.geometry is None:
            return None
        return Raster(self.geometry, self.heights, friction=self.friction, soil=self.soil)


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


def map_from(data: bytes, max_samples: int) -> MapInput:
    """Read a Heightmap message. Checks sizes before any allocation; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    reader.number("i"), reader.number("I")  # map_load_time
    resolution, columns, rows = reader.number("f"), reader.number("I"), reader.number("I")
    x, y, z, *orientation = reader.numbers("d", 7)
    heights, velocities, friction = (reader.sequence("f4") for _ in range(3))
    soil = reader.sequence("u1")
    if not rows and not columns and not len(heights):
        return MapInput(start, None, heights, None)
    _require_count(columns, rows, len(heights), len(velocities), max_samples)
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(x, y, z),
                            yaw=yaw_from(*orientation))  # fmt: skip
    if len(soil) not in (0, rows * columns):
        raise InputError("length", f"{len(soil)} soils for {rows * columns} heights; there must be as many, or none")
    grids = _grids(heights, velocities, (rows, columns))
    places = soil.reshape(rows, columns) if len(soil) else None
    return MapInput(start, geometry, *grids, _friction(friction, (rows, columns)), places)


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
    vertices, velocities = _vertices(reader, max_samples)
    return MeshInput(start, vertices, triangles, velocities)


def mesh_update_from(data: bytes, max_samples: int) -> MeshUpdateInput:
    """Read a TerrainMeshUpdate message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    indices = reader.sequence("u4")
    return MeshUpdateInput(start, indices if len(indices) else None, *_vertices(reader, max_samples))


def _vertices(reader: CdrReader, max_samples: int) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    vertices, velocities = reader.sequence("f8", 3), reader.sequence("f8", 3)
    require_cells(len(vertices), max_samples)
    return vertices, velocities if len(velocities) else None


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


def yaw_from(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about z [rad] of a unit quaternion that rotates about no other axis."""
    length = math.hypot(x, y, z, w)
    if not math.isfinite(length) or abs(length - 1.0) > QUATERNION_SLACK:
        raise InputError("quaternion", f"the map's orientation ({x}, {y}, {z}, {w}) is not a unit quaternion")
    if math.hypot(x, y) > QUATERNION_SLACK:
        raise InputError("quaternion", f"the map is tilted (x = {x}, y = {y}); it may be rotated about z only")
    return 2.0 * math.atan2(z, w)


def require_cells(count: int, max_samples: int) -> None:
    """Raise `InputError` if there are more samples than allowed. Called before memory is allocated."""
    if count > max_samples:
        raise InputError("size", f"{count} samples are more than terrain.max_samples = {max_samples}")


# Default of the most elements in a sequence of messages or strings.
MOST_ITEMS = 100_000


def message_from(data: bytes, kind: Any, most: int = MOST_ITEMS) -> Any:
    """Decode a message of type ``kind`` from its bytes.

    Raises `InputError` if the bytes are no such message, or if a sequence of messages or strings has more than ``most``
    elements, which is checked before anything is allocated.
    """
    _check(CdrReader(data), _fields_to_check(kind), most, last=True)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001  # the decoder's errors have no common base
        raise InputError("malformed", f"{len(data)} bytes are no {kind.__name__}: {error}") from None


def _check(reader: CdrReader, fields: list[Any], most: int, *, last: bool) -> None:
    """Skip fields, checking the sequences in them. ``last``: no check follows, so the last one need not be skipped."""
    for index, field in enumerate(fields):
        _check_field(reader, field, most, last=last and index == len(fields) - 1)


def _check_field(reader: CdrReader, field: Any, most: int, *, last: bool) -> None:
    if isinstance(field, BasicType):
        reader.skip(DTYPES[field.typename].itemsize)
    elif isinstance(field, AbstractString):
        reader.skip(1, reader.count(1))
    elif isinstance(field, NamespacedType):
        kind = _class_of(*field.namespaced_name())
        _check(reader, _fields_to_check(kind) if last else kind.SLOT_TYPES, most, last=last)
    else:
        items = field.value_type
        count = field.size if isinstance(field, Array) else reader.count(1)
        if isinstance(items, BasicType):
            reader.skip(DTYPES[items.typename].itemsize, count)
        elif count > most:
            raise InputError("size", f"{count} elements in one sequence are more than the {most} allowed")
        elif not last or _needs_check(items):
            _check(reader, [items] * count, most, last=False)


def _needs_check(field: Any) -> bool:
    """Return True if a field is or contains a sequence of messages or strings."""
    if isinstance(field, NamespacedType):
        return bool(_fields_to_check(_class_of(*field.namespaced_name())))
    return isinstance(field, AbstractNestedType) and not isinstance(field.value_type, BasicType)


@cache
def _fields_to_check(kind: Any) -> list[Any]:
    """Return the types of a message's fields up to the last one that needs a check."""
    fields = list(kind.SLOT_TYPES)
    while fields and not _needs_check(fields[-1]):
        fields.pop()
    return fields


@cache
def _class_of(*name: str) -> Any:
    return getattr(import_module(".".join(name[:-1])), name[-1])
