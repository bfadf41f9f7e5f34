"""Bodies found below the ground are put back onto it.

No collider is perfect: a body may be spawned under ground, teleported there, or hit by another. The guard is the last
resort, is counted, and can be switched off to see what the colliders do without it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch
from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.ground import Ground
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.terrain import MainMesh

# Speed along the ground that a rescued body keeps at most [m/s].
FASTEST_RESCUED = 5.0
# Bodies whose middle is nearer to the plane along the ground under them are looked at closely [radii].
NEAR = 0.5
# Who was found above ground at rest is not looked at closely again before going this share of that, or for so long [s]:
# it may go into a cliff.
CLEAR, AGAIN = 0.25, 0.05


class Guard:
    """Looks after the bodies on one `Ground`."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        # Of which followers and maps it is known where and when bodies were found how far above the ground [m].
        self._followers: list[Follower] = []
        self._maps: list[tuple[MainMesh, int]] = []
        self._places_w, self._room, self._asked = np.empty((0, 3)), np.empty(0), np.empty(0)

    def rescue(self, client: Any, bodies: list[Body | None], time: float) -> int:
        """Puts bodies that are below the ground back onto it and says how many; ``bodies``: by the followers' indices,
        None = stays where it is, since its pose is dictated."""
        lifts: dict[str, tuple[Body, float, float]] = {}
        ground = self._ground
        for index, height, rate in zip(*(values.tolist() for values in self._below(time)), strict=True):
            body, follower = bodies[index], ground.followers[index]
            if body is not None:
                lift = float(height - ground.positions_w[index, 2] + follower.radius)
                if body.name not in lifts or lift > lifts[body.name][1]:  # a robot as far as its link that needs most
                    lifts[body.name] = (body, lift, rate)
        for body, lift, rate in lifts.values():
            put_back(client, body, lift, rate)
            ground.placed(body.uid)
        return len(lifts)

    def _below(self, time: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Bodies whose middle is under the ground, by index (k,); height [m] and vertical velocity [m/s] of the ground
        above them (k,)."""
        ground, positions_w = self._ground, self._ground.positions_w
        index = suspects(ground.carrying, positions_w, ground.radii)
        if not index.size or self._clear(index, time):
            return np.empty(0, np.int64), np.empty(0), np.empty(0)
        heights, velocities = ground.terrain.at(positions_w[index, :2], time)
        room = positions_w[index, 2] - heights
        self._places_w[index], self._room[index] = positions_w[index], np.maximum(room, 0.0)
        self._asked[index] = time
        below = room < 0.0
        rates = np.zeros(len(index)) if velocities is None else np.nan_to_num(velocities)
        return index[below], heights[below], rates[below]

    def _clear(self, index: IntArray, time: float) -> bool:
        """Whether all bodies of ``index`` (k,) are still about where they were found above ground at rest."""
        ground, meshes = self._ground, self._ground.terrain.tiles.values()
        maps = [(mesh, mesh.version) for mesh in meshes]
        if self._followers is not ground.followers or self._maps != maps or any(mesh.moving(time) for mesh in meshes):
            self._followers, self._maps = ground.followers, maps
            count = len(self._followers)
            self._places_w, self._room, self._asked = np.zeros((count, 3)), np.zeros(count), np.full(count, np.inf)
        gone = ground.positions_w[index] - self._places_w[index]
        near = np.einsum("ij,ij->i", gone, gone) < (CLEAR * self._room[index]) ** 2
        ago = time - self._asked[index]
        return bool((near & (ago >= 0.0) & (ago < AGAIN)).all())


def suspects(batches: list[PatchBatch], positions_w: FloatArray, radii: FloatArray) -> IntArray:
    """Bodies that may be under the ground, by the batches' indices (k,), as are their places (N, 3) [m] and bounding
    ``radii`` (N,) [m]: those whose middle is not well above the plane under them, or their patch."""
    found: list[IntArray] = []
    for batch in batches:
        bodies = batch.bodies
        if isinstance(batch, GridBatch | PlaneBatch) and batch.points_w is not None and batch.normals_w is not None:
            above = np.einsum("ij,ij->i", positions_w[bodies] - batch.points_w, batch.normals_w)
            under = above < NEAR * radii[bodies]
        else:
            tops = batch.heights_w if isinstance(batch, GridBatch) else batch.vertices_w()[..., 2]
            under = positions_w[bodies, 2] < np.fmax.reduce(tops, axis=1)
        if under.any():
            found.append(bodies[under])
    return np.concatenate(found) if found else np.empty(0, np.int64)


def put_back(client: Any, body: Body, lift: float, rate: float) -> None:
    """Lifts a body (a robot as a whole) by ``lift`` [m] and gives it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body.uid)
    linear, angular = client.getBaseVelocity(body.uid)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body.uid, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body.uid, (along[0], along[1], rate), angular)
