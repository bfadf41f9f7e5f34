"""Rays onto the bodies of a world, by PyBullet's ray test, and onto the ground, whose colliders PyBullet's rays do not
meet."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.surface_query import RayCaster, Rays
from smartmesh_ros.world.bodies import Body

# Values of `RayHits.hits` that are no index of a body.
NOTHING, GROUND = -1, 0
# Most rays in one call of PyBullet; it refuses more than 16384.
MOST_RAYS = 8192
# Most surfaces that a ray passes through, of bodies that do not count.
MOST_SURFACES = 32


class RayHits(NamedTuple):
    """What N rays meet first.

    ``distances`` (N,) [m], infinity = nothing. ``normals`` (N, 3): unit normals of the surfaces, NaN = nothing.
    ``hits`` (N,): index into ``names``, whose first is ``ground``; -1 = nothing.
    """

    distances: FloatArray
    normals: FloatArray
    hits: IntArray
    names: tuple[str, ...]


def cast_rays(
    client: Any, bodies: Mapping[str, Body], caster: RayCaster, rays: Rays, time: float, through: Collection[str] = ()
) -> RayHits:
    """Return what rays meet at ``time`` [s]: the ground at that time, or bodies where they are now. Rays pass through
    the bodies named in ``through``."""
    distances, normals = caster.cast(rays, time)
    hits = np.where(np.isfinite(distances), GROUND, NOTHING)
    chosen = [body for name, body in bodies.items() if name not in through]
    found = RayHits(distances, normals, hits, ("ground", *(body.name for body in chosen)))
    if not chosen:
        return found
    reach = np.minimum(distances, rays.reach)
    bounds = np.array([client.getAABB(body.uid, link) for body in chosen for link in body.links], np.float64)
    near = np.flatnonzero(CORE.may_meet(rays.origins, rays.directions, reach, bounds.reshape(-1, 6)))
    numbers = {body.uid: number for number, body in enumerate(chosen, 1)}
    for start in range(0, len(near), MOST_RAYS):
        _cast_on_bodies(client, numbers, rays, near[start : start + MOST_RAYS], found)
    return found


def _cast_on_bodies(client: Any, numbers: dict[int, int], rays: Rays, near: IntArray, found: RayHits) -> None:
    """Write the hits of the rays ``near`` (n,) on bodies, given their ``numbers`` by PyBullet body. A ray that starts
    inside a body passes through it."""
    # PyBullet reports the nearest surface (-1), or the surface of a given rank.
    for rank in range(-1, MOST_SURFACES):
        starts, length = rays.origins[near], np.minimum(found.distances[near], rays.reach)
        ends = starts + rays.directions[near] * length[:, None]
        hits = client.rayTestBatch(starts.tolist(), ends.tolist(), reportHitNumber=rank)
        found_numbers = np.array([numbers.get(hit[0], GROUND) for hit in hits])
        shares = np.array([hit[2] for hit in hits])
        met = np.array([hit[0] >= 0 for hit in hits])
        skipped = met & ((found_numbers == GROUND) | (shares <= 0.0))
        kept = np.flatnonzero(met & ~skipped)
        rays_hit = near[kept]
        found.distances[rays_hit], found.hits[rays_hit] = (shares * length)[kept], found_numbers[kept]
        found.normals[rays_hit] = np.array([hits[k][4] for k in kept.tolist()]).reshape(-1, 3)
        near = near[skipped]
        if not near.size:
            return
