"""Reading of messages with terrain from untrusted CDR bytes, arrays without a copy.

The middleware drops malformed messages silently, and decodes oversized ones before a callback can refuse them. So the
node subscribes to raw bytes, and checks them here before decoding.
"""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, from_numbers
from smartmesh_ros.terrain.deck import QUATERNION_SLACK
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.material import NAMES, Material, require_layer, usual

FloatGrid = NDArray[np.float32]
# Most samples in all maps together.
MOST_SAMPLES = 16_384**2


class Stamped(NamedTuple):
    """A header and the name after it: stamp (seconds and nanoseconds), frame without a leading slash, which means
    nothing, as to tf2, and the tile of a terrain message or the child frame of a transform."""

    sec: int
    nanosec: int
    frame_id: str
    name: str


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
        return Stamped(self.number("i"), self.number("I"), self.text().strip("/"), self.text())

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
    """A whole map as a raster; None = remove the tile."""

    start: Stamped
    raster: Raster | None


class RegionInput(NamedTuple):
    """New heights (rows, columns) [m] of a rectangle, its first row and column, velocities [m/s] or None, and
    what is said of its material."""

    start: Stamped
    row: int
    column: int
    heights: FloatGrid
    velocities: FloatGrid | None
    material: Material = Material()


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


def map_from(data: bytes) -> MapInput:
    """Read a Heightmap message. Checks sizes before any allocation; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    reader.number("i"), reader.number("I")  # map_load_time
    resolution, columns, rows = reader.number("f"), reader.number("I"), reader.number("I")
    x, y, z, *orientation = reader.numbers("d", 7)
    heights, velocities, friction = (reader.sequence("f4") for _ in range(3))
    layers = [("friction", friction), ("soil", reader.sequence("u1")), *_layers(reader)]
    if not rows and not columns and not len(heights):
        return MapInput(start, None)
    _require_count(columns, rows, len(heights), len(velocities))
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(x, y, z),
                            yaw=yaw_from(*orientation))  # fmt: skip
    shape = rows, columns
    grid, speeds = _grids(heights, velocities, shape)
    return MapInput(start, Raster(geometry, grid, None, _material(layers, shape), speeds))


def region_from(data: bytes) -> RegionInput:
    """Read a HeightmapUpdate message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    column, row, columns, rows = (reader.number("I") for _ in range(4))
    heights, velocities = reader.sequence("f4"), reader.sequence("f4")
    layers, shape = _layers(reader), (rows, columns)
    _require_count(columns, rows, len(heights), len(velocities))
    return RegionInput(start, row, column, *_grids(heights, velocities, shape), _material(layers, shape))


def mesh_from(data: bytes) -> MeshInput:
    """Read a TerrainMesh message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    triangles = reader.sequence("u4", 3)
    vertices, velocities = _vertices(reader)
    return MeshInput(start, vertices, triangles, velocities)


def mesh_update_from(data: bytes) -> MeshUpdateInput:
    """Read a TerrainMeshUpdate message; the arrays are views of ``data``."""
    reader = CdrReader(data)
    start = reader.stamped()
    indices = reader.sequence("u4")
    return MeshUpdateInput(start, indices if len(indices) else None, *_vertices(reader))


def _vertices(reader: CdrReader) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    vertices, velocities = reader.sequence("f8", 3), reader.sequence("f8", 3)
    require_cells(len(vertices))
    return vertices, velocities if len(velocities) else None


def _grids(heights: Any, velocities: Any, shape: tuple[int, int]) -> tuple[FloatGrid, FloatGrid | None]:
    """Return flat arrays as views (rows, columns)."""
    return heights.reshape(shape), velocities.reshape(shape) if len(velocities) else None


def _layers(reader: CdrReader) -> list[tuple[str, NDArray[Any]]]:
    """Read the names and values of MaterialLayer messages."""
    count = reader.count(8)
    if count > len(NAMES):
        raise InputError("layer", f"{count} layers of a material; there are {', '.join(NAMES)}")
    return [(reader.text(), reader.sequence("f4")) for _ in range(count)]


def _material(layers: list[tuple[str, NDArray[Any]]], shape: tuple[int, int]) -> Material:
    """Return the material of flat layers; one value is that of all samples, and none says nothing."""
    found: dict[str, Any] = {}
    for name, values in layers:
        require_layer(name)
        if not len(values):
            continue
        if name in found:
            raise InputError("layer", f"the layer {name} is there twice; give it once")
        if len(values) == 1 and name != "soil":
            found[name] = usual(name) if math.isnan(values[0]) else float(values[0])
        elif len(values) == shape[0] * shape[1]:
            found[name] = from_numbers(name, values).reshape(shape)
        else:
            what = f"{len(values)} values of {name} for {shape[0] * shape[1]} heights"
            raise InputError("length", f"{what}; there must be as many, or one, or none")
    return Material(**found)


def _require_count(width: int, height: int, heights: int, velocities: int) -> None:
    count = width * height
    require_cells(count)
    if heights != count:
        raise InputError("length", f"{heights} heights for {height} rows x {width} columns; there must be {count}")
    if velocities not in (0, count):
        raise InputError("length", f"{velocities} velocities for {count} heights; there must be as many, or none")


def yaw_from(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about z [rad] of a unit quaternion that rotates about no other axis."""
    length = math.hypot(x, y, z, w)
    if not math.isfinite(length) or abs(length - 1.0) > QUATERNION_SLACK:
        words = f"the map's orientation ({x}, {y}, {z}, {w}) has length {length:.4g}; a rotation has length 1"
        raise InputError("quaternion", f"{words}, such as (0, 0, 0, 1)")
    if math.hypot(x, y) > QUATERNION_SLACK:
        raise InputError("quaternion", f"the map is tilted (x = {x}, y = {y}); it may be rotated about z only")
    return 2.0 * math.atan2(z, w)


def require_cells(count: int) -> None:
    """Raise `InputError` if there are more samples than allowed. Called before memory is allocated."""
    if count > MOST_SAMPLES:
        raise InputError("size", f"{count} samples; at most {MOST_SAMPLES} are possible in all maps")
