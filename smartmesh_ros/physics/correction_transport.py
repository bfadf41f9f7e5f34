"""Moves bodies with corrections of the ground under them: sets their poses and keeps their velocities.

For each body, one plane is fitted to the ground as shown before the correction and one to the correction itself. The
body is rotated as the first plane tilts and moved vertically by the second plane, about the foot below its middle. A
body that lay on the ground therefore lies on it again, at the same velocity. A robot moves as a whole, by the ground
under the links that stand on it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Point, scaled
from smartmesh_ros.patches.foot import local_body
from smartmesh_ros.patches.rotations import product
from smartmesh_ros.patches.shapes import solid_of
from smartmesh_ros.patches.solids import Solid, extents
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.bullet_sleep import is_fixed
from smartmesh_ros.physics.followers import Followers
from smartmesh_ros.terrain.moving_grid import MovingGrid, surface_at_sample, to_world

# Largest height of a body's lowest point above the ground at which the body moves with a correction [m]. High enough
# for stacked bodies, so that stacks stay whole.
HIGHEST_MOVED = 1.0
# Points on a side of the sampling grid under a shape.
POINTS = 5
# Share of a shape's rounding radius by which the sampling grid is wider than its core. Small, because a ball touches
# the ground at one point.
ROUNDED_SHARE = 0.25
# Weight of links that do not stand on the ground, relative to links that do.
AIRBORNE_WEIGHT = 1e-6
# Points determine no plane if their spread along one direction is less than this share of the spread along the other
# (ratio of the determinant of their second moments to the squared trace).
THIN = 1e-4
# Sums over the points under a body: weights, and products with x, y, the height before and the correction.
SUMS = 12


class CorrectionTransport:
    """Moves the bodies of a PyBullet world with corrections of the ground."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def move_bodies(self, moves: list[tuple[int, MovingGrid, MovingGrid]], followers: Followers, supports: Any) -> None:
        """Move the bodies on corrected tiles; ``moves``: each tile's number, and its grid before and after the
        correction."""
        solid = followers.solid
        bodies = [followers[slot].body for slot in solid.tolist()]
        uids = list(dict.fromkeys(bodies))
        places = {uid: place for place, uid in enumerate(uids)}
        owners = np.array([places[body] for body in bodies], np.int64)
        poses = np.array([self._pose(uid) for uid in uids]).reshape(-1, 7)
        sums = np.zeros((len(uids), SUMS))
        for tile, before, after in moves:
            gather(before, after, tile, solid, owners, followers.shapes, followers.states, supports, poses, sums)
        moved = np.empty(7)
        for place, uid in enumerate(uids):
            if sums[place, 0] > 0.0 and corrected_pose(sums[place], poses[place], moved):
                self._put(uid, moved.tolist())

    def _pose(self, uid: int) -> tuple[float, ...]:
        position, turn = self._client.getBasePositionAndOrientation(uid)
        return (*position, *turn)

    def _put(self, uid: int, pose: list[float]) -> None:
        client = self._client
        if is_fixed(client, uid):
            return
        linear, angular = client.getBaseVelocity(uid)
        client.resetBasePositionAndOrientation(uid, pose[:3], pose[3:])
        client.resetBaseVelocity(uid, linear, angular)


@compiled
def height_on(grid, row, column):
    """Height of the ground at a fractional sample [m]; NaN beyond the map and over holes."""
    rows, columns = grid.heights.shape
    if not (0.0 <= row <= rows - 1.0 and 0.0 <= column <= columns - 1.0):
        return math.nan
    height, _ = surface_at_sample(grid, row, column, grid.shown)
    return height


@compiled
def level_axes(solid: Solid) -> tuple[Point, Point]:
    """Return the two most level axes of a solid, as long as the half extents of the sampling grid along them [m]."""
    wider = ROUNDED_SHARE * solid.rounding
    u = scaled(solid.u, solid.half.x + wider)
    v = scaled(solid.v, solid.half.y + wider)
    w = scaled(solid.w, solid.half.z + wider)
    if abs(solid.u.z) > abs(solid.v.z) and abs(solid.u.z) > abs(solid.w.z):
        return v, w
    if abs(solid.v.z) > abs(solid.w.z):
        return u, w
    return u, v


@compiled
def gather(before, after, tile, chosen, owners, shapes, states, supports, poses, sums):
    """Add the points under the followers in the slots ``chosen`` (n,) on a tile to the ``sums`` (B, SUMS) of their
    PyBullet bodies.

    ``owners`` (n,): row of each follower's PyBullet body in ``sums``. ``poses`` (B, 7): of the PyBullet bodies, which
    are the origins of the points.
    """
    local = np.empty(13)
    for k in range(len(chosen)):
        i = chosen[k]
        stands = supports[i].state != Support.NONE
        if stands and supports[i].tile != tile:
            continue
        local_body(before, states[i], local)
        solid = solid_of(shapes, i, local)
        spacing = before.resolution
        ground = height_on(before, solid.centre.y / spacing, solid.centre.x / spacing)
        if not stands and not solid.centre.z - extents(solid).z - ground <= HIGHEST_MOVED:
            continue
        a, b = level_axes(solid)
        weight = 1.0 if stands else AIRBORNE_WEIGHT
        total, pose = sums[owners[k]], poses[owners[k]]
        for m in range(POINTS):
            for n in range(POINTS):
                s, t = 2.0 * m / (POINTS - 1) - 1.0, 2.0 * n / (POINTS - 1) - 1.0
                row, column = (
                    (solid.centre.y + s * a.y + t * b.y) / spacing,
                    (solid.centre.x + s * a.x + t * b.x) / spacing,
                )
                old, new = height_on(before, row, column), height_on(after, row, column)
                if math.isnan(old) or math.isnan(new):
                    continue
                x, y = to_world(before, row, column)
                x, y, rise = x - pose[0], y - pose[1], new - old
                total[0] += weight
                total[1] += weight * x
                total[2] += weight * y
                total[3] += weight * x * x
                total[4] += weight * x * y
                total[5] += weight * y * y
                total[6] += weight * old
                total[7] += weight * x * old
                total[8] += weight * y * old
                total[9] += weight * rise
                total[10] += weight * x * rise
                total[11] += weight * y * rise


@compiled
def fitted_slopes(sxx: float, sxy: float, syy: float, sxz: float, syz: float) -> tuple[float, float]:
    """Least-squares slopes along x and y of the plane through points with these second moments about their mean; zero
    if the points lie nearly along a line and determine no plane."""
    determinant = sxx * syy - sxy * sxy
    if determinant <= THIN * (sxx + syy) * (sxx + syy):
        return 0.0, 0.0
    return (sxz * syy - syz * sxy) / determinant, (syz * sxx - sxz * sxy) / determinant


@compiled
def fitted(total, first):
    """Mean, and slopes along x and y, of the plane fitted to the values whose sums start at ``first``."""
    n, sx, sy, value = total[0], total[1], total[2], total[first]
    sxx, sxy, syy = total[3] - sx * sx / n, total[4] - sx * sy / n, total[5] - sy * sy / n
    sxz, syz = total[first + 1] - sx * value / n, total[first + 2] - sy * value / n
    slope_x, slope_y = fitted_slopes(sxx, sxy, syy, sxz, syz)
    return value / n, slope_x, slope_y


@compiled
def corrected_pose(total, pose, moved):
    """Write the corrected pose of a body at ``pose`` (7,) to ``moved`` (7,), from the sums of the points under it;
    returns False if the ground did not change."""
    x0, y0 = total[1] / total[0], total[2] / total[0]
    height, hx, hy = fitted(total, 6)
    rise, gx, gy = fitted(total, 9)
    if rise == 0.0 and gx == 0.0 and gy == 0.0:
        return False
    # The foot, relative to the body's middle: the nearest point of the plane before the correction.
    over = (pose[2] - (height - hx * x0 - hy * y0)) / (1.0 + hx * hx + hy * hy)
    away_x, away_y, away_z = -hx * over, -hy * over, over
    foot_x, foot_y = hx * over, hy * over
    lift = rise + gx * (foot_x - x0) + gy * (foot_y - y0)
    # The shortest rotation from the normal before the correction to the normal after it.
    ax, ay, bx, by = -hx, -hy, -hx - gx, -hy - gy
    x, y, z = ay - by, bx - ax, ax * by - ay * bx
    w = math.sqrt((1.0 + ax * ax + ay * ay) * (1.0 + bx * bx + by * by)) + 1.0 + ax * bx + ay * by
    length = math.sqrt(x * x + y * y + z * z + w * w)
    turn = (x / length, y / length, z / length, w / length)
    back = (-turn[0], -turn[1], -turn[2], turn[3])
    arm = product(product(turn, (away_x, away_y, away_z, 0.0)), back)
    moved[0], moved[1] = pose[0] + arm[0] - away_x, pose[1] + arm[1] - away_y
    moved[2] = pose[2] + arm[2] - away_z + lift
    moved[3], moved[4], moved[5], moved[6] = product(turn, (pose[3], pose[4], pose[5], pose[6]))
    return True
