"""Puts bodies that are below the ground back onto it.

A body may be spawned below the ground, teleported there, covered by a map, or pushed there by another body. The guard
is the last resort. Its rescues are counted, and it can be switched off to test the contacts alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.followers import Followers

# Largest horizontal speed that a rescued body keeps [m/s].
FASTEST_RESCUED = 5.0


def put_back(client: Any, followers: Followers, below: list[tuple[int, float, float]]) -> list[int]:
    """Lift the bodies ``below`` the ground (see `Ground.below`) onto it, robots as a whole; returns their PyBullet
    bodies."""
    lifts: dict[int, tuple[float, float]] = {}
    for slot, lift, rate in below:
        body = followers[slot].body
        if body not in lifts or lift > lifts[body][0]:  # a robot by the largest lift of its links
            lifts[body] = (lift, rate)
    for body, (lift, rate) in lifts.items():
        _lift(client, body, lift, rate)
    return list(lifts)


def _lift(client: Any, body: int, lift: float, rate: float) -> None:
    """Lift a body by ``lift`` [m] and give it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body)
    linear, angular = client.getBaseVelocity(body)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body, (along[0], along[1], rate), angular)
