"""Contacts between bodies and the ground."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.physics.ground import Ground
from smartmesh_ros.terrain.grid import FloatArray


@dataclass(frozen=True)
class GroundContact:
    """A contact of a body, or a robot's link, with the ground.

    ``position``: on the ground's surface [m]. ``normal``: unit, from the ground into the body. ``depth`` [m]: positive
    when they overlap. ``normal_force`` [N]: NaN for tracked bodies.
    """

    body: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth: float
    normal_force: float


def ground_contacts(client: Any, ground: Ground, names: list[str]) -> list[GroundContact]:
    """Contacts with the ground in the last step, and those of tracked bodies with their patches as they are.

    ``names``: of the ground's followers, in their order.
    """
    followers = ground.followers
    colliders = {
        follower.collider: name
        for follower, name in zip(followers, names, strict=True)
        if follower.collider is not None
    }
    contacts = contacts_of_step(client, colliders)
    for batch in ground.batches:
        members = [i for i, index in enumerate(batch.bodies) if not followers[index].solid]
        if members:
            bodies = batch.bodies[members]
            radii = np.array([followers[index].radius for index in bodies])
            chosen = [names[index] for index in bodies]
            contacts += contacts_of_spheres(chosen, ground.positions_w[bodies], radii, batch, members)
    return contacts


def contacts_of_step(client: Any, colliders: dict[int, str]) -> list[GroundContact]:
    """Contacts of the last step with the ``colliders``, which map PyBullet bodies to the names of their followers."""
    contacts = []
    for point in client.getContactPoints():
        first, second = colliders.get(point[1]), colliders.get(point[2])
        if second is not None:  # PyBullet's normal points from the second body to the first
            contacts.append(GroundContact(second, point[6], point[7], -point[8], point[9]))
        elif first is not None:
            x, y, z = point[7]
            contacts.append(GroundContact(first, point[5], (-x, -y, -z), -point[8], point[9]))
    return contacts


def contacts_of_spheres(
    names: list[str], centres_w: FloatArray, radii: FloatArray, batch: PatchBatch, members: list[int]
) -> list[GroundContact]:
    """Deepest contact of n tracked spheres with their patches, which are rows ``members`` of the batch.

    Where the centre is below the surface the contact is that of a sphere pushed through the ground.
    """
    vertices = batch.vertices_w()[members][:, batch.triangles]  # (n, T, 3, 3)
    nearest = _closest_points(centres_w[:, None, :], vertices)
    offsets = centres_w[:, None, :] - nearest
    distance = np.where(np.isnan(offsets).any(axis=2), np.inf, np.linalg.norm(offsets, axis=2))
    best = np.argmin(distance, axis=1)
    contacts = []
    for i, name in enumerate(names):
        triangle = vertices[i, best[i]]
        face = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        offset, gap = offsets[i, best[i]], float(distance[i, best[i]])
        if not np.isfinite(gap):
            continue
        below = bool(np.dot(offset, face) < 0.0)
        normal = offset / gap if gap > 1e-9 else face / np.linalg.norm(face)
        depth = radii[i] + gap if below else radii[i] - gap
        if depth > 0.0:
            position = tuple(nearest[i, best[i]].tolist())
            contacts.append(
                GroundContact(
                    name, position, tuple((-normal if below else normal).tolist()), float(depth), float("nan")
                )
            )
    return contacts


def _closest_points(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Closest point of each triangle (..., 3, 3) to the points (..., 3), by clamped projection onto its edges."""
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    normal = np.cross(b - a, c - a)
    area = np.sum(normal * normal, axis=-1)
    inner = points - normal * (np.sum((points - a) * normal, axis=-1) / area)[..., None]
    inside = np.ones(inner.shape[:-1], bool)
    best = np.empty_like(inner)
    least = np.full(inner.shape[:-1], np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        inside &= np.sum(np.cross(edge, inner - start) * normal, axis=-1) >= 0.0
        along = np.clip(np.sum((points - start) * edge, axis=-1) / np.sum(edge * edge, axis=-1), 0.0, 1.0)
        candidate = start + edge * along[..., None]
        gap = np.sum((points - candidate) ** 2, axis=-1)
        closer = gap < least
        best[closer] = candidate[closer]
        least[closer] = gap[closer]
    result: FloatArray = np.where(inside[..., None], inner, best)
    return result
