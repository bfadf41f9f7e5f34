"""The general main mesh: any shape, any triangle pattern, moving vertices."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.checked_heights import (
    checked_ahead,
    checked_next_time,
    checked_numbers,
    checked_time,
    unmasked,
)
from smartmesh_ros.terrain.grid import MAX_COORDINATE, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import Samples, ground_heights
from smartmesh_ros.terrain.motion import CLOCK, INSTANT, MotionConfig, MovingGround, checked_motion, next_revision


class MeshSamples(NamedTuple):
    """Vertices at one instant: positions (n, 3) [m] and velocities (n, 3) [m/s]."""

    positions: FloatArray
    velocities: FloatArray


class TriangleMesh(MovingGround):
    """A triangle mesh with moving vertices and constant triangles (the report's general case).

    ``vertices``: (V, 3) [m] in the terrain's frame. ``triangles``: (T, 3) indices, counter-clockwise seen from the side
    of the bodies. ``time`` [s]: instant of the vertices. ``velocities``: of the vertices (V, 3) [m/s]; by default the
    difference quotient of successive positions.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        *,
        time: float = 0.0,
        velocities: ArrayLike | None = None,
        motion: MotionConfig | None = None,
    ) -> None:
        time, positions = checked_time(time), _checked_places(vertices, None)
        self.triangles = _checked_triangles(triangles, len(positions))
        # The mesh of the C++ core, whose memory the arrays are.
        self.core_reader: Any = CORE.Mesh(positions.T.copy(), self.triangles)
        self._now: FloatArray = self.core_reader.vertices
        self._velocities = self.core_reader.velocities
        self._offsets, self._rates = self.core_reader.offsets, self.core_reader.rates
        self._clocks = self.core_reader.clocks.view(CLOCK)[..., 0]
        self._clocks["time"] = self._clocks["opened"] = time
        self._motion = checked_motion(motion)
        self._set_motion()
        self.version = 0
        self._revision = next_revision()
        if velocities is not None:
            self.move(vertices, time=time, velocities=velocities)
        self.triangles.setflags(write=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the mesh, or one in another process, is made of: arrays, and what they mean."""
        mesh = {"vertices": self.vertices, "triangles": self.triangles, "motion": self.motion}
        return {**self._moving_state(), "mesh": mesh}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the mesh of such a state."""
        TriangleMesh.__init__(self, **state["mesh"])
        self._take_moving(state)
        self._set_motion()
        self.core_reader.shown = state["shown"]

    @property
    def size(self) -> int:
        """Number of vertices."""
        return int(self._now.shape[1])

    @property
    def description(self) -> str:
        """Kind and size as text."""
        return f"mesh of {self.size} vertices and {len(self.triangles)} triangles"

    @property
    def vertices(self) -> FloatArray:
        """Positions at the last update (V, 3) [m]; read-only."""
        view = self._now.T.view()
        view.setflags(write=False)
        return view

    def move(
        self,
        vertices: ArrayLike,
        *,
        time: float,
        indices: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
    ) -> None:
        """Move all vertices, or those of ``indices`` (n,), to new positions (n, 3) [m]; the others are at rest.
        Raises `InputError` and then changes nothing."""
        time = checked_next_time(time, self.time)
        chosen = None if indices is None else _checked_indices(indices, self.size)
        count = self.size if chosen is None else len(chosen)
        new = _checked_places(vertices, count).T
        speeds = None if velocities is None else _checked_vectors(velocities, count, "velocities").T
        given = None if speeds is None else np.ascontiguousarray(speeds)
        intervals = self.motion.min_interval, self.motion.max_interval
        CORE.move_vertices(self.core_reader, chosen, np.ascontiguousarray(new), given, time, intervals)
        self.version += 1
        self._revision = next_revision()

    @property
    def revision(self) -> int:
        """Revision of the last update."""
        return self._revision

    def _set_motion(self) -> None:
        self.core_reader.set_motion(self.motion.code, self.motion.max_velocity, self.motion.smoothing)

    def moving(self, time: float) -> bool:
        """Return True if any vertex may move at ``time`` [s]."""
        return bool(self.core_reader.moves(checked_time(time)))

    def sample(self, indices: IntArray, time: float, ahead: float = INSTANT) -> MeshSamples:
        """Return vertices (n,) at ``time`` [s]; velocities are means over the time ``ahead`` [s]. Raises
        `InputError`."""
        numbers = checked_numbers(indices).reshape(-1)
        return MeshSamples(*CORE.sample_mesh(self.core_reader, numbers, checked_time(time), checked_ahead(ahead)))

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Return the highest ground at N points (N, 2) [m] at ``time`` [s]; NaN where there is no triangle."""
        return ground_heights(CORE.Tiles([self.core_reader]), xy_w, time)


def grid_triangles(rows: int, columns: int) -> NDArray[np.int64]:
    """Return the triangles (T, 3) of a grid of rows x columns vertices, in the report's pattern (Figure 3)."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    return np.stack([lower, upper], axis=1).reshape(-1, 3)


def _checked_triangles(triangles: ArrayLike, count: int) -> IntArray:
    corners = unmasked(triangles, "triangles")
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) == 0:
        raise InputError("length", f"triangles have shape {corners.shape}; it must be (T, 3), with at least one")
    if corners.dtype.kind not in "iu":
        raise InputError("type", f"triangles are of type {corners.dtype}; they must be whole numbers")
    corners = np.array(corners, np.int64, order="C")
    if corners.min() < 0 or corners.max() >= count:
        wrong = corners.min() if corners.min() < 0 else corners.max()
        raise InputError("index", f"a triangle uses vertex {wrong}; there are {count}, counted from 0")
    if (corners == np.roll(corners, 1, axis=1)).any():
        raise InputError("index", "a triangle uses the same vertex twice; its corners must be distinct")
    return corners


def _checked_places(vertices: ArrayLike, count: int | None) -> FloatArray:
    places = _checked_vectors(vertices, count, "vertices")
    if (farthest := np.abs(places).max(initial=0.0)) > MAX_COORDINATE:
        raise InputError("geometry", f"vertices are up to {farthest:g} m away; at most {MAX_COORDINATE:g} is possible")
    return places


def _checked_vectors(values: ArrayLike, count: int | None, what: str) -> FloatArray:
    array = unmasked(values, what)
    if array.ndim != 2 or array.shape[1] != 3 or (count is not None and len(array) != count):
        raise InputError("length", f"{what} have shape {array.shape}; it must be ({count or 'V'}, 3)")
    if array.dtype.kind not in "fiu":
        raise InputError("type", f"{what} are of type {array.dtype}; they must be real numbers")
    if not np.isfinite(array).all():
        raise InputError("non_finite", f"{what} contain numbers that are not finite; every coordinate must be")
    return array.astype(np.float64)


def _checked_indices(indices: ArrayLike, size: int) -> IntArray:
    chosen = unmasked(indices, "indices")
    if chosen.ndim != 1 or chosen.dtype.kind not in "iu":
        raise InputError("length", f"indices have shape {chosen.shape}; they must be a list of whole numbers")
    chosen = chosen.astype(np.int64)
    if len(chosen) and (chosen.min() < 0 or chosen.max() >= size):
        raise InputError("index", f"an update contains vertex {chosen.min()} or {chosen.max()}; there are {size}")
    if len(np.unique(chosen)) != len(chosen):
        raise InputError("index", "an update contains a vertex twice; each may move once")
    return chosen
