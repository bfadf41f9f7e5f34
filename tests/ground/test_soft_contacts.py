"""Stiffness and damping of contacts: of PyBullet's `changeDynamics`, and of a URDF's ``<contact>``."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Sphere
from tests.bodies import ground_of, height, put
from tests.grounds import end_of, level
from tests.urdfs import link, robot

GRAVITY, RADIUS = 9.81, 0.1
RATES = [60.0, 240.0, 960.0]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("is_rigid", [False, True])
@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_a_soft_body_sinks_by_weight_over_stiffness_and_as_its_damping_says(
    client: Any, rate: float, is_rigid: bool, rise: float
) -> None:
    """Also into ground that rises [m/s], and deeper than what Bullet corrects apart from forces."""
    client.setTimeStep(1.0 / rate)
    for stiffness, share in ((10000.0, 0.1), (150.0, 1.5)):
        surface, start, first = level(), 1.0 / 60.0, rise / 60.0
        surface.replace(np.full(surface.heights.shape, first), time=start)
        ball = put(client, Sphere(RADIUS), (0.01, 0.02, RADIUS + first), useMaximalCoordinates=is_rigid)
        damping = share * stiffness
        client.changeDynamics(ball, -1, contactStiffness=stiffness, contactDamping=damping, linearDamping=0.0)
        client.resetBaseVelocity(ball, (0.0, 0.0, rise))
        sunk = []
        with closing(ground_of(client, surface, ball)) as ground:
            for step in range(round(4.0 * share * rate)):
                time = start + step / rate
                if step * 60 % rate < 60:
                    surface.replace(np.full(surface.heights.shape, rise * time), time=time)
                ground.step(time, 1.0 / rate)
                sunk.append(RADIUS + rise * (time + 1.0 / rate) - height(client, ball))
        client.removeBody(ball)
        times, rest = np.arange(1, len(sunk) + 1) / rate, GRAVITY / stiffness
        law = rest * (1.0 - np.exp(-times / share))  # the inertia of the ball hardly counts
        error = 0.01 + 0.5 / (rate * share)  # of the implicit Euler method
        assert sunk == pytest.approx(law.tolist(), abs=error * rest)


def test_a_robots_foot_is_as_soft_as_its_description_says() -> None:
    contact = '<contact><stiffness value="2000"/><damping value="200"/></contact>'
    end = end_of(level(), robot(link("foot", mass=2.0, more=contact)), BodyState((0.0, 0.0, RADIUS)), 480)
    assert RADIUS - end.position[2] == pytest.approx(2.0 * GRAVITY / 2000.0, abs=2e-5)
