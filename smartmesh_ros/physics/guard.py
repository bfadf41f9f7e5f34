"""Puts bodies that are below the ground back onto it.

No collider is perfect: a body may be spawned below the ground, teleported there, or pushed there by another body. The
guard is the last resort. Its rescues are counted, and it can be switched off to test the colliders alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.config import SELECTION
from smartmesh_ros.patches.selection import window_memory
from smartmesh_ros.patches.selector import rules_for
from smartmesh_ros.patches.shapes import solid_of
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.impact import height_at_rest
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

if TYPE_CHECKING:
    from smartmesh_ros.physics.ground import Ground

# Largest horizontal speed that a rescued body keeps [m/s].
FASTEST_RESCUED = 5.0
# Height of a body's middle above the plane under it below which the exact height of the ground is checked [radii].
SUSPECT_HEIGHT = 0.5


class Guard:
    """Rescues the bodies on one `Ground`."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._memory = window_memory(SELECTION.most_samples + 3)

    def rescue(self, client: Any, time: float) -> int:
        """Put bodies that are below the ground back onto it and return their number."""
        ground, followers = self._ground, self._ground.followers
        if not followers.solid.size:
            return 0
        middles = middles_of(followers.solid, followers.shapes, followers.states)
        if ground.exact:
            found = followers.table["own"][followers.solid]
        else:
            found = possibly_buried(
                followers.solid, middles, ground.supports, followers.shapes, followers.table, SUSPECT_HEIGHT
            )
        slots, middles = followers.solid[found], middles[found]
        if not slots.size:
            return 0
        heights, velocities = (
            ground.exact_ground(middles, time) if ground.exact else ground.terrain.at(middles[:, :2], time)
        )
        below = middles[:, 2] < heights
        lifts: dict[int, tuple[float, float]] = {}
        for slot, height, rate in zip(
            *(values[below].tolist() for values in (slots, heights, velocities)), strict=True
        ):
            body = followers[slot].body
            lift = self._lift(slot, height, time)
            if body not in lifts or lift > lifts[body][0]:  # a robot by the largest lift of its links
                lifts[body] = (lift, rate)
        for body, (lift, rate) in lifts.items():
            put_back(client, body, lift, rate)
            ground.placed(body)
        return len(lifts)

    def _lift(self, slot: int, height: float, time: float) -> float:
        """Return the lift that puts a follower's lowest point onto the ground [m]."""
        ground = self._ground
        body, shapes = ground.followers.states[slot], ground.followers.shapes
        lift = height - body[2] + shapes.table["radius"][slot]
        for mesh in ground.terrain.tiles.values():
            if isinstance(mesh, HeightMap) and mesh.beyond(body[None])[0] <= 0.0:
                rules = rules_for(ground.config, SELECTION, 0.0, across=False)
                exact = height_at_rest(mesh.moved_to(time), shapes, slot, body, time, rules, *self._memory[:2])
                return float(lift if math.isnan(exact) else exact)
        return float(lift)


@compiled
def middles_of(chosen: IntArray, shapes: Any, states: FloatArray) -> FloatArray:
    """Return the middles of the shapes of the followers in the slots ``chosen`` (n,) (n, 3) [m]. The centre of mass of
    a link may be beside its shape, and then below the ground without harm."""
    middles = np.empty((len(chosen), 3))
    for k in range(len(chosen)):
        centre = solid_of(shapes, chosen[k], states[chosen[k]]).centre
        middles[k, 0], middles[k, 1], middles[k, 2] = centre.x, centre.y, centre.z
    return middles


@compiled
def possibly_buried(
    chosen: IntArray, middles: FloatArray, supports: Any, shapes: Any, table: Any, near: float
) -> BoolArray:
    """Return which of the followers in the slots ``chosen`` (n,) may be under the ground (n,): those without support,
    and those whose middle (n, 3) is not well above the plane under them. ``table``: records of ``FOLLOWER``; only
    bodies that may be lifted count."""
    found = np.zeros(len(chosen), np.bool_)
    for k in range(len(chosen)):
        i = chosen[k]
        if not table[i].own:
            continue
        support = supports[i]
        above = (
            (middles[k, 0] - support.foot_x) * support.facet_x
            + (middles[k, 1] - support.foot_y) * support.facet_y
            + (middles[k, 2] - support.foot_z) * support.facet_z
        )
        found[k] = support.state == Support.NONE or above < near * shapes.table[i].radius
    return found


def put_back(client: Any, body: int, lift: float, rate: float) -> None:
    """Lift a body (a robot as a whole) by ``lift`` [m] and give it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body)
    linear, angular = client.getBaseVelocity(body)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body, (along[0], along[1], rate), angular)
