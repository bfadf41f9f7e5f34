"""Bodies that would run into the ground within a step arrive at its surface instead, and leave it slowly.

PyBullet finds a collision only once bodies overlap: what falls at 8 m/s is 33 mm deep in the ground at 240 Hz before
anything stops it, and what is small and fast is through. Its own remedy (CCD) ignores that the ground moves. Here the
part of a body's velocity that closes the gap is scaled for one step so that it just arrives, and given back after it:
the solver then meets the collision at the surface and at the true speed. A body that is deep in the ground all the
same (spawned there, or the ground jumped) would be thrown out in proportion; its speed is capped.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch
from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.carrying import cross
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.ground import Ground
from smartmesh_ros.physics.shapes import support
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.terrain import Terrain

# Bodies arrive this deep in the ground, so that the next step finds them in contact [m].
ARRIVAL = 1e-4
# What would come no deeper is left to the solver [m], and what would come so many times as deep as by falling from rest
# for a step: all that lies on the ground would.
SHALLOW, FALLING = 5e-4, 1.25
# A slowed body whose speed is another than gravity made it has met the ground already [m/s].
MET = 1e-3
# The path of bodies that move further than this share of their radius in a step is looked at in so many places.
FAR, PLACES = 0.25, 16
# Balls within so many radii of the plane under them, and as near as they come in a step, are looked at closely.
NEAR = 1.5
# Ground that accelerates runs into bodies on it no further than this in a step [m].
RESTING = 0.002
# A body deeper than this leaves the ground no faster than that [m, m/s].
DEEP, FASTEST_ESCAPE = 0.01, 1.0
# Where the ground under a ball is sampled, in radii (33, 2).
_TURNS = np.arange(8) * 0.25 * math.pi
_CIRCLE = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_DISC = np.concatenate([np.zeros((1, 2)), *(share * _CIRCLE for share in (0.15, 0.3, 0.5, 0.7))])


class Approach(NamedTuple):
    """n bodies near the ground, by their index: distance of their middles from it and how much nearer they come in a
    step (n,) [m], the ground's normal (n, 3) and velocity (n, 3) [m/s] there, and the bodies' paths relative to it in
    the step (n, 3) [m]."""

    bodies: IntArray
    distance: FloatArray
    closing: FloatArray
    normals_w: FloatArray
    ground_w: FloatArray
    paths: FloatArray

    def of(self, rows: BoolArray) -> Approach:
        """Those in ``rows`` (n,)."""
        return Approach(
            self.bodies[rows], self.distance[rows], self.closing[rows], self.normals_w[rows], self.ground_w[rows],
            self.paths[rows],
        )  # fmt: skip


class Radii(NamedTuple):
    """Radii of spheres inside and around bodies, by the followers' indices (N,) [m]; of what is not slowed, such as
    tracked bodies and links, -inf."""

    inner: FloatArray
    outer: FloatArray

    @classmethod
    def of(cls, bodies: list[Body | None]) -> Radii:
        """Of simulated bodies; None = not to be slowed."""
        shapes = [None if body is None else body.shape for body in bodies]
        inner = [-math.inf if shape is None else shape.inner_radius for shape in shapes]
        outer = [-math.inf if shape is None else shape.bounding_radius for shape in shapes]
        return cls(np.array(inner, np.float64), np.array(outer, np.float64))


class Landings(NamedTuple):
    """Bodies that are slowed for one step, their indices, the velocities taken from them and those left to them
    (n, 3) [m/s]."""

    uids: list[int]
    followers: list[int]
    taken: FloatArray
    left: FloatArray


class Escape(NamedTuple):
    """A body deep in the ground, whose normal (3,) and velocity (3,) [m/s] are given."""

    uid: int
    normal: FloatArray
    ground: FloatArray


class Meeting(NamedTuple):
    """What was done before a step and is to be undone after it: slowed bodies, and bodies deep in the ground with
    their velocities (3,) [m/s]."""

    landings: Landings
    escapes: list[Escape]
    before: list[FloatArray]


def meet(
    client: Any, ground: Ground, bodies: list[Body | None], radii: Radii, met: list[int], time: float,
    physics: PhysicsConfig,
) -> Meeting | None:  # fmt: skip
    """Has bodies arrive at the ground's surface in the coming step; ``bodies``, ``radii`` (N,): by the followers'
    indices; ``met``: who did in the last one, and is left to the solver. None where there is nothing to undo."""
    dt, positions = physics.dt, ground.positions_w
    ahead = positions + ground.moved_w + np.array(physics.gravity) * (dt * dt)
    found = approaches(ground.carrying, positions, ahead, time, dt)
    if found is None:
        return None
    waiting = ~np.isin(found.bodies, met) if met else np.ones(len(found.bodies), bool)
    shallow = max(SHALLOW, FALLING * math.hypot(*physics.gravity) * dt * dt)
    landings = slow_down(
        BulletCalls(client), found.of(waiting), bodies, radii, ground.terrain, positions, time, dt, shallow
    )
    escapes = deep_bodies(found, bodies, radii)
    return Meeting(landings, escapes, velocities(client, escapes))


def part(client: Any, ground: Ground, meeting: Meeting, physics: PhysicsConfig) -> list[int]:
    """Gives bodies their velocity back after the step, and has those deep in the ground leave it slowly. Returns the
    followers that have met the ground: slowed again, they would never feel it, and gain speed for ever."""
    uids, followers, taken, left = meeting.landings
    met: list[int] = []
    if uids:
        given_back = np.array(BulletCalls(client).add_velocities(uids, taken.tolist()))
        ground.will_move(followers, given_back * physics.dt)
        pushed = np.abs(given_back - taken - left - np.multiply(physics.gravity, physics.dt)).max(axis=1) > MET
        met = [followers[row] for row in np.flatnonzero(pushed)]
    hold_back(client, meeting.escapes, meeting.before)
    return met


def approaches(
    batches: list[PatchBatch], positions_w: FloatArray, next_w: FloatArray, time: float, dt: float
) -> Approach | None:
    """Bodies and the ground under them at ``time`` [s], where it is known; ``next_w`` (N, 3) [m]: where they will be
    after the step of ``dt`` [s]."""
    known = [
        (batch.bodies, batch.points_w, batch.normals_w, batch.linear_w, batch.angular_w, batch.centres_w,
         np.full((len(batch.bodies), 1), time - batch.time))
        for batch in batches
        if isinstance(batch, GridBatch | PlaneBatch) and batch.points_w is not None and batch.normals_w is not None
    ]  # fmt: skip
    if not known:
        return None
    index, points, normals, linear, angular, centres, age = map(np.concatenate, zip(*known, strict=True))
    ground = linear + cross(angular, points - centres)
    points += age * ground
    paths = next_w[index] - positions_w[index] - ground * dt
    distance = np.einsum("ij,ij->i", positions_w[index] - points, normals)
    return Approach(index, distance, -np.einsum("ij,ij->i", paths, normals), normals, ground, paths)


def slow_down(
    calls: BulletCalls,
    approach: Approach,
    bodies: list[Body | None],
    radii: Radii,
    terrain: Terrain,
    positions_w: FloatArray,
    time: float,
    dt: float,
    shallow: float,
) -> Landings:
    """Slows the bodies that would run into the ground in the coming step, deeper than ``shallow`` [m]; ``bodies``,
    ``radii``: by index."""
    approach = approach.of((approach.closing > shallow) & (radii.outer[approach.bodies] > 0.0))
    if not approach.bodies.size:
        return Landings([], [], np.empty((0, 3)), np.empty((0, 3)))
    approach = _seen_closely(approach, radii, terrain, positions_w, time)
    inner, outer = radii.inner[approach.bodies], radii.outer[approach.bodies]
    lands = (approach.distance - inner > ARRIVAL) & (approach.closing - approach.distance + outer > shallow)
    far = np.einsum("ij,ij->i", approach.paths, approach.paths) > (FAR * outer) ** 2
    slowed = lands | far
    approach, inner, outer, far = approach.of(slowed), inner[slowed], outer[slowed], far[slowed]
    reach = outer.copy()
    for row in np.flatnonzero(inner != outer).tolist():  # what is no ball reaches as far as it is turned
        body = bodies[approach.bodies[row]]
        assert body is not None
        assert body.shape is not None
        reach[row] = support(body.shape, calls.orientation(body.uid), approach.normals_w[row])
    gap = approach.distance - reach
    lands = (gap > ARRIVAL) & (approach.closing - gap > shallow)
    changes = np.where(lands, (approach.closing - gap - ARRIVAL) / dt, 0.0)[:, None] * approach.normals_w
    for row in np.flatnonzero(far).tolist():
        start, path = positions_w[approach.bodies[row]], approach.paths[row]
        normal = approach.normals_w[row]
        share = _free_share(terrain, start, path + changes[row] * dt, float(outer[row]), normal, time)
        changes[row] += (share - 1.0) * (path / dt + changes[row])
    chosen = changes.any(axis=1)
    followers, changes = approach.bodies[chosen].tolist(), changes[chosen]
    uids = [body.uid for body in (bodies[index] for index in followers) if body is not None]
    left = np.array(calls.add_velocities(uids, changes.tolist())).reshape(-1, 3)
    return Landings(uids, followers, -changes, left)


def _seen_closely(approach: Approach, radii: Radii, terrain: Terrain, positions_w: FloatArray, time: float) -> Approach:
    """The same with the nearest point of the ground under balls that come near: on curved ground that is not where the
    plane under them has it."""
    inner, outer = radii.inner[approach.bodies], radii.outer[approach.bodies]
    near = (inner == outer) & (approach.distance <= NEAR * outer + approach.closing)
    # What rests on the ground comes nearer to it only by the ground's acceleration.
    near &= (approach.distance - outer > ARRIVAL) | (approach.closing > RESTING)
    rows = np.flatnonzero(near)
    if rows.size:
        index = approach.bodies[rows]
        feet = positions_w[index] - approach.distance[rows, None] * approach.normals_w[rows]
        distance, normals = nearest_ground(terrain, positions_w[index], feet, radii.outer[index], time)
        approach.distance[rows], approach.normals_w[rows] = distance, normals
        approach.closing[rows] = -np.einsum("ij,ij->i", approach.paths[rows], normals)
    return approach


def nearest_ground(
    terrain: Terrain, centres: FloatArray, feet: FloatArray, radii: FloatArray, time: float
) -> tuple[FloatArray, FloatArray]:
    """Distance (k,) [m] of balls' ``centres`` (k, 3) [m] from the ground below them and its unit normals there (k, 3),
    from samples within their ``radii`` (k,) [m] and at their ``feet`` (k, 3) on the planes under them."""
    points = np.empty((len(centres), 1 + len(_DISC), 3))
    points[:, 0, :2], points[:, 1:, :2] = feet[:, :2], centres[:, None, :2] + radii[:, None, None] * _DISC
    points[..., 2] = terrain.at(points[..., :2].reshape(-1, 2), time).heights.reshape(points.shape[:2])
    away = centres[:, None] - points
    distances = np.nan_to_num(np.sqrt(np.einsum("ijk,ijk->ij", away, away)), nan=np.inf)
    body, nearest = np.arange(len(centres)), distances.argmin(axis=1)
    distance, away = distances[body, nearest], away[body, nearest]
    unclear = ~((distance > 0.0) & (distance < np.inf) & (away[:, 2] > 0.0))  # over a hole, or under the ground
    away[unclear] = centres[unclear] - feet[unclear]
    distance[unclear] = np.maximum(np.linalg.norm(away[unclear], axis=1), np.finfo(float).tiny)
    return distance, away / distance[:, None]


def deep_bodies(approach: Approach, bodies: list[Body | None], radii: Radii) -> list[Escape]:
    """Bodies that are deep in the ground."""
    escapes = []
    for row in np.flatnonzero(approach.distance < radii.inner[approach.bodies] - DEEP).tolist():
        body = bodies[approach.bodies[row]]
        if body is not None and body.shape is not None:
            escapes.append(Escape(body.uid, approach.normals_w[row], approach.ground_w[row]))
    return escapes


def hold_back(client: Any, escapes: list[Escape], before: list[FloatArray]) -> None:
    """Caps the speed, away from the ground, of bodies that leave it, but not below what they had ``before`` [m/s]."""
    for (uid, normal, ground), old in zip(escapes, before, strict=True):
        linear, angular = client.getBaseVelocity(uid)
        speed = float((np.array(linear) - ground) @ normal)
        most = max(FASTEST_ESCAPE, float((old - ground) @ normal))
        if speed > most:
            client.resetBaseVelocity(uid, (np.array(linear) + (most - speed) * normal).tolist(), angular)


def velocities(client: Any, escapes: list[Escape]) -> list[FloatArray]:
    """Velocities of bodies deep in the ground [m/s]."""
    return [np.array(client.getBaseVelocity(escape.uid)[0]) for escape in escapes]


def _free_share(
    terrain: Terrain, start: FloatArray, path: FloatArray, radius: float, normal: FloatArray, time: float
) -> float:
    """Share of a ``path`` (3,) [m], relative to the ground, that a ball goes before it meets ground (about, when the
    ground is not smooth)."""
    shares = np.linspace(0.0, 1.0, PLACES + 1)
    places = start + shares[:, None] * path
    ground = terrain.at(places[:, :2], time).heights
    clearance = (places[:, 2] - ground) * normal[2] - radius
    met = np.flatnonzero(clearance < -SHALLOW)
    if not met.size:
        return 1.0
    last = int(met[0])
    if last == 0:
        return 0.0 if clearance[1] < clearance[0] else 1.0
    over, under = float(clearance[last - 1]), float(clearance[last])
    return float(shares[last - 1] + (shares[last] - shares[last - 1]) * max(over, 0.0) / max(over - under, 1e-12))
