"""Bodies found below the ground are put back onto it.

No collider is perfect: a body may be spawned under ground, teleported there, or hit by another. The guard is the last
resort, is counted, and can be switched off to see what the colliders do without it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch
from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.ground import Ground
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain

# Speed along the ground that a rescued body keeps at most [m/s].
FASTEST_RESCUED = 5.0
# Bodies whose middle is nearer to the plane along the ground under them are looked at closely [radii].
NEAR = 0.5


def rescue(client: Any, ground: Ground, bodies: list[Body | None], time: float) -> int:
    """Puts bodies that are below the ground back onto it and says how many; ``bodies``: by the followers' indices,
    None = stays where it is, since its pose is dictated."""
    lifts: dict[str, tuple[Body, float, float]] = {}
    found = below_ground(ground.carrying, ground.terrain, ground.positions_w, ground.radii, time)
    for index, height, rate in zip(*(values.tolist() for values in found), strict=True):
        body, follower = bodies[index], ground.followers[index]
        if body is not None:
            lift = float(height - ground.positions_w[index, 2] + follower.radius)
            if body.name not in lifts or lift > lifts[body.name][1]:  # a robot as far as its link that needs most
                lifts[body.name] = (body, lift, rate)
    for body, lift, rate in lifts.values():
        put_back(client, body, lift, rate)
        ground.placed(body.uid)
    return len(lifts)


def below_ground(
    batches: list[PatchBatch], terrain: Terrain, positions_w: FloatArray, radii: FloatArray, time: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Bodies whose middle is under the ground, by the batches' indices (k,), as are their places and bounding ``radii``
    (N,) [m]; height [m] and vertical velocity [m/s] of the ground above them (k,)."""
    suspects: list[IntArray] = []
    for batch in batches:
        bodies = batch.bodies
        if isinstance(batch, GridBatch | PlaneBatch) and batch.points_w is not None and batch.normals_w is not None:
            above = np.einsum("ij,ij->i", positions_w[bodies] - batch.points_w, batch.normals_w)
            under = above < NEAR * radii[bodies]
        else:
            tops = batch.heights_w if isinstance(batch, GridBatch) else batch.vertices_w()[..., 2]
            under = positions_w[bodies, 2] < np.fmax.reduce(tops, axis=1)
        if under.any():
            suspects.append(bodies[under])
    if not suspects:
        return np.empty(0, np.int64), np.empty(0), np.empty(0)
    index = np.concatenate(suspects)
    ground = terrain.at(positions_w[index, :2], time)
    below = positions_w[index, 2] < ground.heights
    rates = np.zeros(len(index)) if ground.velocities is None else np.nan_to_num(ground.velocities)
    return index[below], ground.heights[below], rates[below]


def put_back(client: Any, body: Body, lift: float, rate: float) -> None:
    """Lifts a body (a robot as a whole) by ``lift`` [m] and gives it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body.uid)
    linear, angular = client.getBaseVelocity(body.uid)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body.uid, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body.uid, (along[0], along[1], rate), angular)
