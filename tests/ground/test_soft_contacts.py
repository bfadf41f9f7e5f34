"""Stiffness and damping of contacts: of PyBullet's `changeDynamics`, and of a URDF's ``<contact>``."""

from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Ground, World
from tests.bodies import height
from tests.grounds import level
from tests.urdfs import link, robot

GRAVITY, RADIUS = 9.81, 0.1
RATES = [60.0, 240.0, 960.0]


def soft_ball(client: Any, stiffness: float, damping: float, is_rigid: bool) -> int:
    """A ball of 1 kg that touches the ground."""
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=RADIUS)
    ball = client.createMultiBody(1.0, shape, basePosition=(0.01, 0.02, RADIUS), useMaximalCoordinates=is_rigid)
    client.changeDynamics(ball, -1, contactStiffness=stiffness, contactDamping=damping, linearDamping=0.0)
    return int(ball)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("is_rigid", [False, True])
@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_a_soft_body_sinks_by_weight_over_stiffness_and_as_its_damping_says(
    rate: float, is_rigid: bool, rise: float
) -> None:
    """Also into ground that rises [m/s], and deeper than what Bullet corrects apart from forces."""
    for stiffness, share in ((10000.0, 0.1), (150.0, 1.5)):
        client = BulletClient(pb.DIRECT)
        try:
            client.setGravity(0.0, 0.0, -GRAVITY)
            client.setTimeStep(1.0 / rate)
            surface = level()
            surface.replace(np.full(surface.heights.shape, rise / 60.0), time=1.0 / 60.0)
            ground = Ground(client, surface)
            ball = soft_ball(client, stiffness, share * stiffness, is_rigid)
            ground.attach(ball)
            client.resetBasePositionAndOrientation(ball, (0.01, 0.02, RADIUS + rise / 60.0), (0.0, 0.0, 0.0, 1.0))
            client.resetBaseVelocity(ball, (0.0, 0.0, rise))
            rest, sunk = GRAVITY / stiffness, []
            for step in range(round(4.0 * share * rate)):
                time = 1.0 / 60.0 + step / rate
                if step * 60 % rate < 60:
                    surface.replace(np.full(surface.heights.shape, rise * time), time=time)
                ground.step(time, 1.0 / rate)
                sunk.append(RADIUS + rise * (time + 1.0 / rate) - height(client, ball))
            times = np.arange(1, len(sunk) + 1) / rate
            law = rest * (1.0 - np.exp(-times / share))  # the inertia of the ball hardly counts
            error = 0.01 + 0.5 / (rate * share)  # of the implicit Euler method
            assert sunk == pytest.approx(law.tolist(), abs=error * rest)
        finally:
            client.disconnect()


def test_a_robots_foot_is_as_soft_as_its_description_says() -> None:
    with World(level()) as world:
        contact = '<contact><stiffness value="2000"/><damping value="200"/></contact>'
        world.spawn_robot("foot", robot(link("foot", mass=2.0, more=contact)), BodyState((0.0, 0.0, RADIUS)))
        world.step(480)
        assert RADIUS - world.state("foot").position[2] == pytest.approx(2.0 * GRAVITY / 2000.0, abs=2e-5)
