"""The services that answer questions about the ground in any frame: heights at points, and what rays meet."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from smartmesh_msgs.srv import CastRays, QueryGround
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.ground.quaternions import X, Y, Z, rotate
from smartmesh_ros.ground.transform import IDENTITY, Transform
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.cdr import doubles
from smartmesh_ros.node.services.turns import next_turn, parts_of
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.surface_query import checked_points, checked_rays, ground_samples
from smartmesh_ros.world.body_rays import cast_rays
from smartmesh_ros.world.standing import NO_TERRAIN

# Largest difference between the instant of a question and now [s].
FARTHEST = 1.0
# Tilt of a frame's z axis that counts as rounding [-].
LEVEL = 1e-6


@dataclass(frozen=True)
class AskedFrame:
    """The frame and the instant of a question.

    ``transform``: pose of the frame in the terrain's frame. ``time`` [s]: the instant in simulated time. ``header``:
    frame and stamp that the answer carries.
    """

    transform: Transform
    time: float
    header: Header

    @property
    def rotation(self) -> FloatArray:
        """From the frame to the terrain's frame (3, 3)."""
        return np.array([rotate(self.transform.rotation, axis) for axis in (X, Y, Z)]).T

    def points_w(self, points: FloatArray) -> FloatArray:
        """Return points (N, 3) [m] in the terrain's frame."""
        with np.errstate(all="ignore"):  # numbers that are too large are refused afterwards
            return np.asarray(points @ self.rotation.T + self.transform.translation)

    def vectors_w(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (N, 3) in the terrain's frame."""
        with np.errstate(all="ignore"):
            return np.asarray(vectors @ self.rotation.T)

    def vectors(self, vectors_w: FloatArray) -> FloatArray:
        """Return vectors (N, 3) of the terrain's frame in this frame."""
        return np.asarray(vectors_w @ self.rotation)

    def require_level(self, frame_id: str) -> None:
        """Raise `InputError` if the frame's z axis is not vertical."""
        x, y, z = rotate(self.transform.rotation, Z)
        tilt = math.hypot(x, y)
        if tilt > LEVEL or z < 0.0:
            words = f"frame {frame_id!r} is tilted by {math.degrees(math.atan2(tilt, z)):.3g} degrees, and heights need"
            raise InputError("frame", f"{words} a level one; ask in another frame, or cast rays with ~/cast_rays")


def asked_frame(session: Session, transforms: TransformInput, header: Any) -> AskedFrame:
    """Return the frame and the instant that a request's header asks for. Raises `InputError`: before the first map, for
    an unknown frame, and for a stamp far from now."""
    if session.world.terrain.empty:
        raise InputError("no_map", NO_TERRAIN)
    stamp = stamp_seconds(header.stamp)
    if stamp is None:
        time, instant = session.world.time, stamp_of(session.state_time())
    else:
        instant, age = header.stamp, session.clock_now() - stamp
        if abs(age) > FARTHEST:
            words = f"stamp {stamp:.3f} s is {age:.3f} s before this node's time; ask for an instant within"
            raise InputError("stamp", f"{words} {FARTHEST:g} s of now, or with stamp zero for now")
        time = session.time_at(age)
    answer = Header(stamp=instant, frame_id=header.frame_id or session.frame_id)
    return AskedFrame(_transform(session, transforms, header.frame_id, stamp), time, answer)


def _transform(session: Session, transforms: TransformInput, frame_id: str, stamp: float | None) -> Transform:
    """Return the pose of a frame in the terrain's frame: of a body of that name, or else of a frame of TF."""
    if frame_id in session.world.bodies and frame_id != session.frame_id:
        return Transform.of(session.world.base_state(frame_id))
    listening = transforms.listening
    try:
        return transforms.to_terrain(frame_id, stamp) or IDENTITY
    except InputError as error:
        names = [name for name in session.world.bodies if name]
        there = f"the bodies are {listed(names)}" if names else "there are no bodies"
        again = "" if listening or not transforms.listening else "; the node has just subscribed to /tf, so ask again"
        raise InputError("frame", f"no body is called {frame_id!r} ({there}), and as a frame: {error}{again}") from None


# Most points or rays in one call.
MOST = 100_000
# Points and rays in one turn between two steps, which takes about half a millisecond. More of them delay the steps,
# fewer of them delay the answer.
POINTS_IN_TURN, RAYS_IN_TURN = 2000, 500


class GroundServices:
    """Serves ``~/query_ground`` and ``~/cast_rays``."""

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self._transforms = session, transforms
        session.serve(QueryGround, "query_ground", self._on_query)
        session.serve(CastRays, "cast_rays", self._on_cast)

    async def _on_query(self, request: Any, response: Any) -> None:
        await next_turn()
        _require_count(len(request.x), "points")
        x, y, below = (np.frombuffer(values, np.float64) for values in (request.x, request.y, request.below))
        if len(x) != len(y) or len(below) not in (0, len(x)):
            words = f"{len(x)} x, {len(y)} y and {len(below)} below"
            raise InputError("length", f"{words}; there must be as many of each, or no below")
        asked = asked_frame(self._session, self._transforms, request.header)
        asked.require_level(request.header.frame_id)
        points_w = asked.points_w(np.column_stack([x, y, np.zeros(len(x))]))
        points_w[:, 2] = below + asked.transform.translation[2] if len(below) else np.inf
        points_w = checked_points(points_w)
        parts = []
        for part in parts_of(len(points_w), POINTS_IN_TURN):
            with self._session.lock:
                parts.append(ground_samples(self._session.world.terrain, points_w[part], asked.time))
            await next_turn()
        z, normals, velocities, ages, _ = map(np.concatenate, zip(*parts, strict=True))
        response.z = doubles(z - asked.transform.translation[2])
        response.normals, response.velocities = (doubles(asked.vectors(values)) for values in (normals, velocities))
        response.ages, response.header = doubles(ages), asked.header

    async def _on_cast(self, request: Any, response: Any) -> None:
        await next_turn()
        _require_count(len(request.origins) // 3, "rays")
        origins, directions = (np.frombuffer(values, np.float64) for values in (request.origins, request.directions))
        if len(origins) % 3 or len(origins) != len(directions):
            words = f"{len(origins)} numbers of origins and {len(directions)} of directions"
            raise InputError("length", f"{words}; there must be three of each for every ray")
        world = self._session.world
        asked = asked_frame(self._session, self._transforms, request.header)
        starts, ways = asked.points_w(origins.reshape(-1, 3)), asked.vectors_w(directions.reshape(-1, 3))
        rays = checked_rays(starts, ways, request.range)
        through = set(request.through)
        for name in through:
            world.body(name)
        parts = []
        for part in parts_of(len(rays.origins), RAYS_IN_TURN):
            with self._session.lock:
                found = cast_rays(world.client, world.bodies, world.ground.rays, rays.part(part), asked.time, through)
            met = np.array([*found.names, ""], object)[found.hits]  # -1 is the last
            parts.append((found.distances, found.normals, met))
            await next_turn()
        distances, normals, names = map(np.concatenate, zip(*parts, strict=True))
        response.distances, response.normals = doubles(distances), doubles(asked.vectors(normals))
        response.hits, response.header = names.tolist(), asked.header


def _require_count(count: int, what: str) -> None:
    if count > MOST:
        raise InputError("size", f"{count} {what} in one call; at most {MOST} are possible")
