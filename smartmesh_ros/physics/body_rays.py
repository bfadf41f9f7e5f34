"""Rays onto the bodies of a world, by PyBullet's ray test, and onto the ground, whose colliders PyBullet's rays do not
meet."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.ray_cast import RayCaster, Rays

# Values of `RayHits.hits` that are no index of a body.
NOTHING, GROUND = -1, 0
# Most rays in one call of PyBullet; it refuses more than 16384.
MOST_RAYS = 8192
# Most surfaces that a ray passes through, of bodies that do not count.
MOST_SURFACES = 32
# Most bodies in a group whose common bounds a ray is checked against first.
GROUP = 8


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
    groups = groups_of(_bounds(client, chosen))
    near = np.flatnonzero(may_meet(rays.origins, rays.directions, np.minimum(distances, rays.reach), *groups))
    numbers = {body.uid: number for number, body in enumerate(chosen, 1)}
    for start in range(0, len(near), MOST_RAYS):
        _cast_on_bodies(client, numbers, rays, near[start : start + MOST_RAYS], found)
    return found


def require_bodies(names: Collection[str], bodies: Mapping[str, Body]) -> None:
    """Raise `InputError` if there is no body of one of the names."""
    for name in names:
        if name not in bodies:
            raise InputError("unknown_body", f"there is no body {name!r} for rays to pass through")


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


def _bounds(client: Any, bodies: list[Body]) -> FloatArray:
    """Return the axis-aligned bounds (n, 6) [m] of bodies, and of robots' links."""
    found = [client.getAABB(body.uid, link) for body in bodies for link in (body.links or (-1,))]
    return np.array(found, np.float64).reshape(-1, 6)


def groups_of(bounds: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Sort ``bounds`` (n, 6) [m] into groups that lie together, by halves along their longest extent.

    Returns the bounds in their new order, those around each group (g, 6), and the place where each group begins
    (g + 1,).
    """
    groups, largest = [np.arange(len(bounds))], len(bounds)
    while largest > GROUP:
        halves = []
        for group in groups:
            middles = bounds[group, :3] + bounds[group, 3:]
            order = group[np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")]
            halves += [order[: len(order) // 2], order[len(order) // 2 :]]
        groups, largest = halves, max(map(len, halves))
    around = [np.concatenate([bounds[group, :3].min(axis=0), bounds[group, 3:].max(axis=0)]) for group in groups]
    firsts = np.concatenate([[0], np.cumsum([len(group) for group in groups])])
    return bounds[np.concatenate(groups)], np.array(around), firsts


@compiled
def passes_through(origin: FloatArray, direction: FloatArray, reach: float, box: FloatArray) -> bool:
    """Return True if a ray passes through a ``box`` (6,) [m] within its ``reach`` [m]."""
    begin, end = 0.0, reach
    for axis in range(3):
        rate = direction[axis]
        low, high = box[axis] - origin[axis], box[axis + 3] - origin[axis]
        if rate == 0.0:
            if low > 0.0 or high < 0.0:
                return False
        else:
            begin = max(begin, min(low / rate, high / rate))
            end = min(end, max(low / rate, high / rate))
        if begin > end:
            return False
    return True


@compiled
def may_meet(
    origins: FloatArray, directions: FloatArray, reach: FloatArray, bounds: FloatArray, around: FloatArray,
    firsts: IntArray,
) -> BoolArray:  # fmt: skip
    """Return the rays (N,) that pass through one of the ``bounds`` (n, 6) [m] within their ``reach`` (N,) [m].
    ``bounds``, ``around``, ``firsts``: as of `groups_of`."""
    found = np.zeros(len(origins), np.bool_)
    for i in range(len(origins)):
        for group in range(len(around)):
            if not passes_through(origins[i], directions[i], reach[i], around[group]):
                continue
            for k in range(firsts[group], firsts[group + 1]):
                if passes_through(origins[i], directions[i], reach[i], bounds[k]):
                    found[i] = True
                    break
            if found[i]:
                break
    return found
