"""Worlds at random for some seconds, with what users do to bodies behind a world's back: for `make sanitize`.

Usage: python -m scripts.mixed_scenes SECONDS
"""

from __future__ import annotations

import logging
import sys
import time

import numpy as np

from smartmesh_ros import World
from tests.world.random_worlds import RandomWorld

STEPS, EVERY = 240, 20  # of one world, and from one disturbance to the next


def disturb(world: World, rng: np.random.Generator) -> None:
    """Do one of the things after which a world goes on."""
    uid, kind = int(rng.choice([body.uid for body in world.bodies.values()])), int(rng.integers(5))
    if kind == 0:
        world.client.resetBaseVelocity(uid, rng.normal(scale=100.0, size=3))
    elif kind == 1:
        world.client.resetBasePositionAndOrientation(uid, [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
    elif kind == 2:
        world.client.resetBasePositionAndOrientation(uid, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0])
    elif kind == 3:
        world.restore(world.snapshot())
    else:
        world.ground.wake(uid)


def destroy(world: World) -> None:
    """Take bodies away from under the core, and then everything, with steps in between."""
    client, uids = world.client, [body.uid for body in world.bodies.values()]
    for uid in uids[::3]:
        client.removeBody(uid)
    for uid in uids[1::3]:
        world.ground.detach(uid)
    for _ in range(EVERY):
        client.stepSimulation()
    client.resetSimulation()
    client.stepSimulation()


if __name__ == "__main__":
    logging.getLogger("smartmesh_ros").setLevel(logging.ERROR)  # bodies fall off the map, and commands do not come
    end, count = time.monotonic() + float(sys.argv[1]), 0
    while count == 0 or time.monotonic() < end:
        scene, random = RandomWorld(count), np.random.default_rng(count)
        with scene.world:
            for first in range(0, STEPS, EVERY):
                scene.run(first, first + EVERY)
                disturb(scene.world, random)
            destroy(scene.world)
        count += 1
    print(f"{count} scenes of {STEPS} steps", flush=True)
