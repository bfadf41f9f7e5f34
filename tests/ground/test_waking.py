"""Bodies that PyBullet has put to sleep go with the ground; others are left alone."""

from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import Box, Ground, HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import height, put
from tests.core import mesh_parts

DT = 1.0 / 240.0
SIDE, SPACING = 41, 0.1
ROWS, COLUMNS = np.mgrid[:SIDE, :SIDE]
BUMPS = 0.002 * np.sin(3.0 * ROWS) * np.cos(2.0 * COLUMNS)


def box(client: Any, maximal: bool, sleeps: bool = True) -> int:
    body = put(client, Box(0.3, 0.3, 0.3), (0.0, 0.0, 0.16), useMaximalCoordinates=maximal)
    if sleeps:
        client.changeDynamics(body, -1, activationState=pb.ACTIVATION_STATE_ENABLE_SLEEPING)
    return body


def standing(
    client: Any, *, mesh: bool = False, maximal: bool = True, sleeps: bool = True
) -> tuple[HeightMap | TriangleMesh, Ground, int]:
    """A map or a mesh, the ground of it, and a box that is attached."""
    terrain: Any = HeightMap(BUMPS, resolution=SPACING, origin=(-2.0, -2.0))
    if mesh:
        terrain = TriangleMesh(*mesh_parts.sheet(4.0, 40))
    ground, body = Ground(client, terrain), box(client, maximal, sleeps)
    ground.attach(body)
    return terrain, ground, body


def run(client: Any, ground: Ground, first: int, steps: int, every: int = 1) -> int:
    """Step the world, and bring the ground up to date in every so many steps."""
    for step in range(first, first + steps):
        if step % every == 0:
            ground.update(step * DT, DT)
        client.stepSimulation()
    return first + steps


def asleep(client: Any, ground: Ground, body: int, every: int = 1) -> int:
    """Step until a body sleeps; it may fall asleep between two updates."""
    step = 0
    while step == 0 or any(map(any, client.getBaseVelocity(body))):
        step = run(client, ground, step, 60 if every == 1 else every, every)
        assert step < 6000, "it does not fall asleep"
    return step


@pytest.mark.parametrize(
    ("drop", "maximal", "every", "mesh"),
    [
        *((drop, maximal, 1, False) for drop in (1.0, 0.05, 0.002) for maximal in (False, True)),
        (1.0, True, 4, False), (0.5, True, 1, True),
    ],
)  # fmt: skip
def test_a_sleeping_body_falls_with_its_ground(client: Any, drop: float, maximal: bool, every: int, mesh: bool) -> None:
    """A rigid body or a multibody, whichever step the map comes in."""
    terrain, ground, body = standing(client, mesh=mesh, maximal=maximal)
    step = asleep(client, ground, body, every)
    before = height(client, body)
    if mesh:
        terrain.move(terrain.vertices - (0.0, 0.0, drop), time=step * DT + 100.0)
    else:
        terrain.replace(BUMPS - drop, time=step * DT + 100.0)  # long after: no velocity
    run(client, ground, step, 240)
    assert height(client, body) == pytest.approx(before - drop, abs=2e-3 if drop > 0.01 else 5e-4)


@pytest.mark.parametrize("freezes", [True, False])
def test_a_body_that_pybullet_put_to_sleep_wakes_if_the_slope_under_it_freezes(client: Any, freezes: bool) -> None:
    """And only if the friction under it is another one."""
    slope = HeightMap(0.3 * 0.1 * np.arange(41) * np.ones((41, 1)), resolution=0.1, origin=(-2.0, -2.0), friction=1.0)
    ground, body = Ground(client, slope), box(client, maximal=True)
    client.resetBasePositionAndOrientation(body, (0.0, 0.0, 0.77), client.getQuaternionFromEuler((0, -0.2915, 0)))
    client.changeDynamics(body, -1, lateralFriction=0.8)
    ground.attach(body)
    step, before = asleep(client, ground, body), client.getBasePositionAndOrientation(body)[0][0]
    friction = np.ones((41, 41))
    friction[:, : 30 if freezes else 5] = 0.1
    slope.friction = friction
    run(client, ground, step, 240)
    assert (client.getBasePositionAndOrientation(body)[0][0] < before - 0.1) == freezes
