"""A husky that slides with braked wheels, and one that drives."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.scenes.moving import Scene as MovingGround
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.grounds import Rigid, flat
from studies.configurations import Configuration
from studies.laws.measures import GRAVITY, Residuals, joined, residuals
from studies.laws.trials import ASKEW
from studies.matrix.arena import square
from studies.robots.configurations import build
from studies.robots.engine import FRICTION, RobotEngine, RobotSetup
from studies.robots.reference import centres_of
from studies.robots.robot import HUSKY
from studies.robots.scene import RobotScene
from studies.robots.urdf import prepared

MASS = 44.063  # [kg]


def entered(configuration: Configuration, ground: MovingGround, start: FloatArray, speed: float) -> RobotEngine:
    """Return an engine with a husky whose middle starts at ``start`` (3,) [m] with wheels of a ``speed`` [rad/s]."""
    setup = RobotSetup(
        robot=HUSKY, text=prepared(HUSKY.urdf), starts=start[None], heights=ground.heights(0.0),
        geometry=ground.geometry, dt=1.0 / configuration.rate, speed=speed,
    )  # fmt: skip
    return build(configuration, setup)


def end_of_husky(configuration: Configuration, shift: FloatArray) -> FloatArray:
    """Return where a husky is (3,) [m] that drove over rough ground for a second."""
    scene = RobotScene(robot=HUSKY, motion="maps", resolution=0.1)
    with entered(configuration, scene.ground, scene.starts[0] + shift, HUSKY.speed) as engine:
        for _ in range(round(configuration.rate)):
            engine.step()
        return np.array(centres_of(engine.links())[0])


def residuals_of_husky(configuration: Configuration) -> Residuals | None:
    """Return the residuals of a husky that slides with braked wheels, None if the engine does not tell contacts. The
    ground falls by 30 degrees along no axis of the world, nor of the robot."""
    plane, parts = flat(square(31, 0.1)), []
    fall = np.tan(np.radians(30.0)) * (plane.x * ASKEW[0] + plane.y * ASKEW[1]) / np.hypot(*ASKEW[:2])
    with entered(configuration, Rigid(plane.geometry, -fall), np.array([0.0, 0.0, 0.35]), 0.0) as engine:
        for step in range(round(1.5 * configuration.rate)):
            engine.step()
            contacts = engine.contacts()
            if contacts is None:
                return None
            if step >= 0.5 * configuration.rate:
                parts.append(residuals(contacts, MASS * GRAVITY, FRICTION, 1.0 / configuration.rate))
    return joined(parts)
