"""Boxes and half spaces with their top along the ground, for ground that is flat where a body can touch it.

A box is used instead of PyBullet's endless plane, because the plane's bounds overlap those of every body, and each such
pair costs about 30 ns in a step. A box is as thick as it is wide, so that nothing falls through it. Cylinders and
capsules get the plane nevertheless: PyBullet finds only one contact point at a time between them and a box, so a
standing cylinder would never come to rest and a rolling one would drift aside.
"""

from __future__ import annotations

import math
from typing import Any

import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.physics.colliders.table import COLLIDERS, MISFIT, NOTHING, POSE, VELOCITY, advance, push


def box_size(need: float) -> float:
    """Return the half edge of a box for a body that needs ``need`` around its foot [m]. There are only a few sizes, so
    that boxes can be reused."""
    return float(2.0 ** (0.5 * math.ceil(2.0 * math.log2(COLLIDERS.room * need) - 1e-9)))


def plane_key(support: Any, radius: float, resolution: float, *, round_: bool) -> tuple[float, ...]:
    """Return the half edge of the box for a support [m]; infinite = a half space, for ``round_`` bodies."""
    return (math.inf if round_ else box_size(radius + float(support["margin"])),)


def make_box(client: Any, key: tuple[float, ...]) -> int:
    """Create PyBullet's collision shape of a box, or of a half space if its half edge [m] is infinite."""
    (size,) = key
    if size == math.inf:
        return int(client.createCollisionShape(pb.GEOM_PLANE))
    return int(client.createCollisionShape(pb.GEOM_BOX, halfExtents=[size] * 3))


def describe_box(record: Any, key: tuple[float, ...]) -> None:
    """Write the constants of a box to its record of ``COLLIDER``."""
    (size,) = key
    record["extent"], record["depth"], record["nz"] = size, 0.0 if size == math.inf else size, 1.0


@compiled
def plane_need(support, shape):
    """Radius around a foot within which a body can touch its plane until the next update [m]."""
    return shape.radius + support.margin


@compiled
def plan_plane(collider, support, shape, time, limits, pose, velocity):
    """Return the changes that put a box along the plane of a support, as bits; write its ``pose`` (7,), position [m]
    and orientation (x, y, z, w), and ``velocity`` (6,) [m/s, rad/s]."""
    need = plane_need(support, shape)
    if collider.extent < need:
        return MISFIT
    advance(collider, time)
    foot_x, foot_y, foot_z = support.foot_x, support.foot_y, support.foot_z
    nx, ny, nz, depth = support.facet_x, support.facet_y, support.facet_z, collider.depth
    away_x = foot_x - collider.x - depth * collider.nx
    away_y = foot_y - collider.y - depth * collider.ny
    away_z = foot_z - collider.z - depth * collider.nz
    off = abs(away_x * collider.nx + away_y * collider.ny + away_z * collider.nz)
    normal_change = math.sqrt((nx - collider.nx) ** 2 + (ny - collider.ny) ** 2 + (nz - collider.nz) ** 2)
    aside = math.sqrt(away_x * away_x + away_y * away_y + away_z * away_z)
    stays = collider.there == 1 and off + normal_change * need <= limits.off and aside <= collider.extent - need
    change = NOTHING
    if not stays:
        collider.x, collider.y, collider.z = foot_x - depth * nx, foot_y - depth * ny, foot_z - depth * nz
        collider.nx, collider.ny, collider.nz = nx, ny, nz
        collider.there = 1
        w = math.sqrt(0.5 * (1.0 + nz))  # the shortest rotation from z to the normal
        pose[0], pose[1], pose[2] = collider.x, collider.y, collider.z
        pose[3], pose[4], pose[5], pose[6] = -ny / (2.0 * w), nx / (2.0 * w), 0.0, w
        change = POSE
    if push(collider, support, limits, not stays, velocity):
        change |= VELOCITY
    return change
