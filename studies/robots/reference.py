"""Reference runs of robots: an eighth of the step."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.grid import FloatArray
from studies.reference import HORIZON
from studies.robots.bullet_robots import WorldOptions, WorldRobots
from studies.robots.engine import Links, RobotSetup
from studies.robots.scene import RobotScene

# Rate of the reference's maps, and of its patches [Hz]. The ground's velocity carries them in between.
MAPS = 240.0


def centres_of(links: Links) -> FloatArray:
    """Return where robots are (N, 3) [m]: the mean of the frames of their links."""
    return np.asarray(links.positions.mean(axis=1))


def reference_centres(scene: RobotScene, setup: RobotSetup) -> FloatArray:
    """Return where robots are after `HORIZON` (N, 3) [m].

    On ground at rest the collider is a triangle mesh of the whole map, without a filter of inner edges. On moving
    ground, where a whole collider has no velocity, it is ours, with an eighth of the step.
    """
    finest = PatchConfig(rate=MAPS)
    patch = PatchConfig(kind="whole_trimesh") if scene.motion == "rest" else finest
    options = WorldOptions(patch=patch, physics=PhysicsConfig(sleep=False))
    with WorldRobots(setup, options) as engine:
        for step in range(math.floor(HORIZON / setup.dt + 0.5)):
            time = step * setup.dt
            if scene.trot is not None:
                engine.hold(scene.joints(time))
            if scene.map_rate and step and step % round(1.0 / (setup.dt * MAPS)) == 0:
                engine.set_ground(scene.ground.heights(time))
            engine.step()
        return centres_of(engine.links())
