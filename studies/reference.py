"""Reference runs: as accurate as possible, at any cost."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.tools.evaluation.scene import Scene
from studies.engines.bullet import BulletTrimesh, BulletTrimeshOptions
from studies.engines.engine import Engine, EngineBody, Setup
from studies.engines.smartmesh import SmartMesh, SmartMeshOptions

# Step rate of the reference [Hz], and instant of the comparison [s]. A later comparison is meaningless, because
# repeated contacts make the motion chaotic.
FINE_RATE = 8 * 240.0
HORIZON = 1.0


def reference_positions(scene: Scene) -> FloatArray | None:
    """Return the positions (N, 3) [m] of the bodies after `HORIZON`; None if the scene has no reference.

    The collider is a filtered trimesh of the whole map on rigid ground. On moving ground, where a whole collider cannot
    carry the velocity, it is ours with an eighth of the step and a map at every step. Sliding rigid ground is
    simulated in the frame of the ground, where the ground is at rest and the bodies have the opposite velocity.
    """
    if scene.reference == "none":
        return None
    ground = scene.make_ground()
    shape: Any = scene.bodies.make_shape()
    bodies = [EngineBody(shape=shape, state=state, friction=scene.bodies.friction) for state in _starts(scene)]
    heights: Any = ground.heights(0.0)
    setup = Setup(heights=heights, resolution=scene.grid[1], bodies=bodies, dt=1.0 / FINE_RATE)
    if scene.reference == "whole":
        engine: Engine = BulletTrimesh(setup, BulletTrimeshOptions(edge_filter=True))
    else:
        finest = PatchConfig(rate=0.0)
        # A map arrives at every step, so short intervals must not merge maps.
        motion = MotionConfig(min_interval=0.0)
        engine = SmartMesh(setup, SmartMeshOptions(patch=finest, motion=motion))
    with engine:
        for step in range(math.floor(HORIZON * FINE_RATE + 0.5)):
            if scene.moves and scene.reference == "finest":
                moved: Any = ground.heights(step / FINE_RATE)
                engine.set_ground(moved)
            engine.step()
        return engine.positions() + (*((HORIZON * slide) for slide in scene.slide), 0.0)


def _starts(scene: Scene) -> list[BodyState]:
    """Return the initial states of the bodies in the frame of the sliding ground."""
    return [
        replace(state, linear=(state.linear[0] - scene.slide[0], state.linear[1] - scene.slide[1], state.linear[2]))
        for state in scene.starts()
    ]
