"""The services that answer questions about the ground: heights at points, and what rays meet."""

from __future__ import annotations

from typing import Any

import numpy as np
from smartmesh_msgs.srv import CastRays, QueryGround

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.arrays import doubles
from smartmesh_ros.node.services.asked_frame import asked_frame
from smartmesh_ros.node.services.turns import NextTurn, parts_of
from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.surface_query import checked_points, checked_rays, ground_samples
from smartmesh_ros.world.body_rays import RayHits, cast_rays, require_bodies

# Most points or rays in one call.
MOST = 100_000
# Points and rays in one turn between two steps, which takes about half a millisecond. More of them delay the steps,
# fewer of them delay the answer.
POINTS_IN_TURN, RAYS_IN_TURN = 2000, 500


class GroundServices:
    """Serves ``~/query_ground`` and ``~/cast_rays``."""

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self._transforms = session, transforms
        session.serve_in_turns(QueryGround, "query_ground", self._on_query)
        session.serve_in_turns(CastRays, "cast_rays", self._on_cast)

    async def _on_query(self, request: Any, response: Any) -> None:
        _require_count(len(request.x), "points")
        x, y, below = (np.frombuffer(values, np.float64) for values in (request.x, request.y, request.below))
        if len(x) != len(y) or len(below) not in (0, len(x)):
            raise InputError(
                "length", f"{len(x)} x, {len(y)} y and {len(below)} below; there must be as many of each, or no below"
            )
        points = np.column_stack([x, y, below if len(below) else np.full(len(x), np.inf)])
        asked = asked_frame(self._session, self._transforms, request.header)
        asked.require_level(request.header.frame_id)
        points_w = checked_points(asked.points_w(points))
        parts = []
        for part in parts_of(len(points_w), POINTS_IN_TURN):
            with self._session.lock:
                parts.append(ground_samples(self._session.world.terrain, points_w[part], asked.time))
            await NextTurn()
        z, normals, velocities, ages = _joined(parts, ((), (3,), (3,), ()))
        response.z = doubles(z - asked.transform.translation[2])
        response.normals, response.velocities = (doubles(asked.vectors(values)) for values in (normals, velocities))
        response.ages, response.header = doubles(ages), asked.header

    async def _on_cast(self, request: Any, response: Any) -> None:
        _require_count(len(request.origins) // 3, "rays")
        origins, directions = (np.frombuffer(values, np.float64) for values in (request.origins, request.directions))
        if len(origins) % 3 or len(origins) != len(directions):
            raise InputError(
                "length",
                f"{len(origins)} numbers of origins and {len(directions)} of directions; there must be three of each "
                "for every ray",
            )
        world = self._session.world
        asked = asked_frame(self._session, self._transforms, request.header)
        starts, ways = asked.points_w(origins.reshape(-1, 3)), asked.vectors_w(directions.reshape(-1, 3))
        rays = checked_rays(starts, ways, request.range)
        through = set(request.through)
        require_bodies(through, world.bodies)
        parts, names = [], []
        for part in parts_of(len(rays.origins), RAYS_IN_TURN):
            with self._session.lock:
                found = cast_rays(world.client, world.bodies, world.ground.rays, rays.part(part), asked.time, through)
            parts.append((found.distances, found.normals))
            names += names_of(found)
            await NextTurn()
        distances, normals = _joined(parts, ((), (3,)))
        response.distances, response.normals = doubles(distances), doubles(asked.vectors(normals))
        response.hits, response.header = names, asked.header


def names_of(found: RayHits) -> list[str]:
    """Return what each ray meets by name, empty for nothing."""
    names = np.array([*found.names, ""], object)  # -1 is the last
    result: list[str] = names[found.hits].tolist()
    return result


def _require_count(count: int, what: str) -> None:
    if count > MOST:
        raise InputError("size", f"{count} {what} in one call; at most {MOST} are possible")


def _joined(parts: list[Any], shapes: tuple[tuple[int, ...], ...]) -> list[FloatArray]:
    """Return the arrays of all parts, each joined along the first axis; ``shapes``: of one row of each."""
    return [np.concatenate([np.empty((0, *shape)), *(part[k] for part in parts)]) for k, shape in enumerate(shapes)]
