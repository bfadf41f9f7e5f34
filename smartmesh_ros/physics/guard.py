"""Puts bodies that are below the ground back onto it.

A body may be spawned below the ground, teleported there, covered by a map, or pushed there by another body. The guard
is the last resort. Its rescues are counted, and it can be switched off to test the colliders alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Point
from smartmesh_ros.patches.shapes import solid_of
from smartmesh_ros.patches.solids import reach_along
from smartmesh_ros.terrain.grid import FloatArray, IntArray

if TYPE_CHECKING:
    from smartmesh_ros.physics.ground import Ground

# Largest horizontal speed that a rescued body keeps [m/s].
FASTEST_RESCUED = 5.0


class Guard:
    """Rescues the bodies on one `Ground`."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground

    def rescue(self, client: Any, time: float) -> int:
        """Put bodies that are below the ground back onto it and return their number."""
        ground, followers = self._ground, self._ground.followers
        slots = followers.solid[followers.table["own"][followers.solid]]
        if not slots.size:
            return 0
        middles, lowest = middles_of(slots, followers.shapes, followers.states)
        heights, velocities = ground.below(middles, time)
        below = middles[:, 2] < heights
        lifts: dict[int, tuple[float, float]] = {}
        for slot, lift, rate in zip(
            *(values[below].tolist() for values in (slots, heights - lowest, velocities)), strict=True
        ):
            body = followers[slot].body
            if body not in lifts or lift > lifts[body][0]:  # a robot by the largest lift of its links
                lifts[body] = (lift, rate)
        for body, (lift, rate) in lifts.items():
            put_back(client, body, lift, rate)
            ground.placed(body)
        return len(lifts)


@compiled
def middles_of(chosen: IntArray, shapes: Any, states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middles of the shapes of the followers in the slots ``chosen`` (n,) (n, 3) [m], and the heights of the
    shapes' lowest points (n,) [m]. The centre of mass of a link may be beside its shape, and then below the ground
    without harm."""
    middles, lowest = np.empty((len(chosen), 3)), np.empty(len(chosen))
    for k in range(len(chosen)):
        solid = solid_of(shapes, chosen[k], states[chosen[k]])
        middles[k, 0], middles[k, 1], middles[k, 2] = solid.centre.x, solid.centre.y, solid.centre.z
        lowest[k] = solid.centre.z - reach_along(solid, Point(0.0, 0.0, -1.0))
    return middles, lowest


def put_back(client: Any, body: int, lift: float, rate: float) -> None:
    """Lift a body (a robot as a whole) by ``lift`` [m] and give it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body)
    linear, angular = client.getBaseVelocity(body)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body, (along[0], along[1], rate), angular)
