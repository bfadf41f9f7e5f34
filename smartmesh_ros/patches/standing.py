"""What bodies stand on as it was chosen, and how it moves on with the ground until the next look."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch, SurfaceTwist, plane_twist
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.choice import FACET, FACET_RINGS, FIELD, FITTED, FIXED, UNDECIDED
from smartmesh_ros.patches.collect import CollectMethod
from smartmesh_ros.patches.grid_collect import collect_inside
from smartmesh_ros.patches.planes import ALL_NINE, Planes, planes_through
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# A plane that a new map puts further than this from where it was expected is looked at again [m].
JUMP = 0.005
# Stands for the rings of a patch that is a plane.
PLANE = 0

_FILLS = {
    "state": UNDECIDED,
    "rows": 0,
    "columns": 0,
    "middles_w": 0.0,
    "rings": 0,
    "stride": 0,
    "spare": 0,
    "deviation": np.nan,
    "facet": ALL_NINE,
    "plane": 0.0,
    "rate": 0.0,
    "read_at": 0.0,
    "read_from": -1,
    "until": -np.inf,
    "unlooked": 0.0,
}


class Standing:
    """The choices of N bodies.

    ``state``: which, by the numbers in `choice`. The patch: its middle sample by ``rows`` and ``columns``, that one's
    place ``middles_w`` (N, 2) [m], ``rings``, ``stride``, for how many looks a smaller one would have done (``spare``)
    and ``deviation`` from the mesh [m]. ``facet``: that under the body, as by `facet_under`, or `ALL_NINE`. ``plane``,
    ``rate`` (N, 3): coefficients of a plane along the ground in the frame of the middle sample and how they change a
    second, as read at ``read_at`` [s] from version ``read_from`` of the map. ``until`` [s]: when to look again.
    ``unlooked``: for how long [s] a patch of fixed extent was given as looking was in vain, 0 = it was not.
    """

    def __init__(self) -> None:
        self.state = np.empty(0, np.int64)
        self.rows, self.columns = np.empty(0, np.int64), np.empty(0, np.int64)
        self.middles_w = np.empty((0, 2))
        self.rings, self.stride = np.empty(0, np.int64), np.empty(0, np.int64)
        self.spare = np.empty(0, np.int64)
        self.deviation = np.empty(0)
        self.facet = np.empty(0, np.int64)
        self.plane, self.rate = np.empty((0, 3)), np.empty((0, 3))
        self.read_at, self.read_from = np.empty(0), np.empty(0, np.int64)
        self.until, self.unlooked = np.empty(0), np.empty(0)

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def forget(self, bodies: IntArray | slice) -> None:
        """Has bodies looked at anew."""
        self.state[bodies] = UNDECIDED
        self.rings[bodies] = self.stride[bodies] = self.spare[bodies] = 0
        self.until[bodies], self.unlooked[bodies] = -np.inf, 0.0

    def follow(self, heightmap: HeightMap, bodies: IntArray, time: float, method: CollectMethod) -> None:
        """Reads the planes under ``bodies`` (n,) anew where the ground does not move on as it was read."""
        state = self.state[bodies]
        stale = (state == FACET) | (state == FITTED) | (state == FIELD)
        steady = time <= heightmap.steady_until
        if steady:
            stale &= self.read_from[bodies] != heightmap.version
        if not stale.any():
            return
        bodies, state = bodies[stale], state[stale]
        if steady:
            reach = self.stride[bodies] * np.where(state == FIELD, self.rings[bodies], FACET_RINGS)
            rows, columns, version = self.rows[bodies], self.columns[bodies], self.read_from[bodies]
            changed = heightmap.clocks.changed(rows, columns, reach, version)
            self.read_from[bodies] = heightmap.version
            bodies, state = bodies[changed], state[changed]
            if not bodies.size:
                return
        cells, stride = Cells(self.rows[bodies], self.columns[bodies]), self.stride[bodies]
        ground = collect_inside(heightmap, patch_template(1), cells, stride, time, method)
        which = np.where(state == FITTED, ALL_NINE, self.facet[bodies])
        spacing = stride * heightmap.geometry.resolution
        planes = planes_through(ground.heights, which, spacing, holes=ground.holes)
        expected = self.plane[bodies] + self.rate[bodies] * (time - self.read_at[bodies])[:, None]
        # Not so either where a hole came up.
        jumped = ~(np.abs(planes[:, 0] - expected[:, 0]) <= JUMP)
        self.plane[bodies], self.read_at[bodies], self.read_from[bodies] = planes, time, heightmap.version
        self.rate[bodies] = 0.0
        if ground.velocities is not None:
            self.rate[bodies] = planes_through(ground.velocities, which, spacing, holes=False)
        if jumped.any():
            self.until[bodies[jumped]] = -np.inf

    def batches(
        self, name: str, heightmap: HeightMap, bodies: IntArray, positions_w: FloatArray, time: float,
        method: CollectMethod,
    ) -> tuple[list[PatchBatch], IntArray]:  # fmt: skip
        """Patches of ``bodies`` (n,) at ``positions_w`` (n, 3) [m] on the tile ``name`` at ``time`` [s], a batch per
        size, and which of them get one of fixed extent instead (m,)."""
        state = self.state[bodies]
        fixed = np.flatnonzero(state == FIXED)
        chosen = np.flatnonzero((state == FACET) | (state == FITTED) | (state == FIELD))
        if not chosen.size:
            return [], fixed
        rings = np.where(state[chosen] == FIELD, self.rings[bodies[chosen]], PLANE)
        order = np.argsort(rings, kind="stable")
        chosen, rings = chosen[order], rings[order]
        bodies = bodies[chosen]
        # That of the ground under the body: the mean over the patch is another one where the velocity is curved.
        twist = self._twist(heightmap, bodies, time)
        centres_w, points_w, normals_w = self._ground(heightmap, bodies, positions_w[chosen], time)
        rows, columns, stride = self.rows[bodies], self.columns[bodies], self.stride[bodies]
        deviation, since = self.deviation[bodies], self.read_at[bodies]
        if time > heightmap.steady_until:
            since[:] = np.nan
        ends = [*(np.flatnonzero(np.diff(rings)) + 1).tolist(), len(bodies)]
        found: list[PatchBatch] = []
        for start, end in zip([0, *ends], ends, strict=False):
            part, size = slice(start, end), int(rings[start])
            template = patch_template(FACET_RINGS if size == PLANE else size)
            common: dict[str, Any] = {
                "tile": name, "bodies": bodies[part], "triangles": template.triangles, "rows": rows[part],
                "columns": columns[part], "stride": stride[part], "centres_w": centres_w[part],
                "surface": SurfaceTwist(twist.linear_w[part], twist.angular_w[part]), "deviation": deviation[part],
                "heightmap": heightmap, "template": template, "points_w": points_w[part],
                "normals_w": normals_w[part], "since": since[part], "time": time,
            }  # fmt: skip
            if size == PLANE:
                found.append(PlaneBatch(kind="plane", **common))
            else:
                spacing: FloatArray = np.multiply(stride[part], heightmap.geometry.resolution, dtype=np.float64)
                found.append(GridBatch(kind="heightfield", spacing=spacing, method=method, **common))
        return found, fixed

    def _twist(self, heightmap: HeightMap, bodies: IntArray, time: float) -> SurfaceTwist:
        """How the planes move at the middle samples."""
        if not heightmap.moving(time):
            return SurfaceTwist(*np.zeros((2, len(bodies), 3)))
        return plane_twist(heightmap, self.rate[bodies])

    def _ground(
        self, heightmap: HeightMap, bodies: IntArray, positions_w: FloatArray, time: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The plane under each body: its point over the middle sample and that nearest to the body (n, 3) [m], and its
        upward normal (n, 3)."""
        plane = self.plane[bodies]
        if heightmap.moving(time):
            plane += self.rate[bodies] * (time - self.read_at[bodies])[:, None]
        return planes_in_world(plane, self.middles_w[bodies], positions_w, heightmap.geometry.yaw)


def planes_in_world(
    planes: FloatArray, middles_w: FloatArray, positions_w: FloatArray, yaw: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Planes by their coefficients (n, 3) around ``middles_w`` (n, 2) [m] of a grid turned by ``yaw`` [rad]: their
    points there and nearest to ``positions_w`` (n, 3) [m], and their upward normals (n, 3)."""
    places_w = np.empty((len(planes), 3))
    places_w[:, :2], places_w[:, 2] = middles_w, planes[:, 0]
    normals_w = turned(Planes(*planes.T).normals(), yaw)
    above = np.einsum("ij,ij->i", positions_w - places_w, normals_w)
    return places_w, positions_w - above[:, None] * normals_w, normals_w


def turned(vectors: FloatArray, yaw: float) -> FloatArray:
    """Vectors (n, 3) of the grid's frame in the world's."""
    if not yaw:
        return vectors
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y, z = vectors.T
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
