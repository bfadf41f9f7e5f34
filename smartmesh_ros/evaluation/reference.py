"""Runs that others are compared with: as true as can be had, whatever it costs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from smartmesh_ros.evaluation.engines.bullet import BulletTrimesh, BulletTrimeshOptions
from smartmesh_ros.evaluation.engines.engine import Engine, EngineBody, Setup
from smartmesh_ros.evaluation.engines.smartmesh import SmartMesh, SmartMeshOptions
from smartmesh_ros.evaluation.scene import Scene
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig

# Steps of the reference [Hz], and when bodies are compared with it [s]: later contacts make their ways chaotic.
FINE_RATE = 8 * 240.0
HORIZON = 1.0


def reference_positions(scene: Scene) -> FloatArray | None:
    """Where the bodies (N, 3) [m] are after `HORIZON`; None where the scene has no reference.

    On rigid ground a filtered trimesh of the whole map; on moving ground, where no whole collider can carry the
    velocity, patches of our finest setting on maps that come with every step. Rigid ground that slides is at rest for
    who slides along with it: bodies move the other way there.
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
        finest = PatchConfig(kind="heightfield", tolerance=1e-4, rate=0.0)
        # Maps that come with every step are none of them a part of another.
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
    """Where bodies start and how fast, for who slides along with the ground."""
    return [
        replace(state, linear=(state.linear[0] - scene.slide[0], state.linear[1] - scene.slide[1], state.linear[2]))
        for state in scene.starts()
    ]
