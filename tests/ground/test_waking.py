"""Bodies that PyBullet has put to sleep go with the ground."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import Box, Ground, HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import height, put
from tests.core import mesh_parts
from tests.grounds import level

DT = 1.0 / 240.0


def sheet() -> TriangleMesh:
    return TriangleMesh(*mesh_parts.sheet(4.0, 40))


def run(client: Any, ground: Ground, first: int, steps: int, every: int) -> int:
    """Step the world, and bring the ground up to date in every so many steps."""
    for step in range(first, first + steps):
        if step % every == 0:
            ground.update(step * DT, DT)
        client.stepSimulation()
    return first + steps


@pytest.mark.parametrize("maximal", [False, True], ids=["multibody", "rigid body"])
@pytest.mark.parametrize(
    ("made", "drop", "every"),
    [(level, 0.05, 1), (level, 0.002, 1), (level, 1.0, 4), (sheet, 0.5, 1)],
    ids=["map", "little", "seldom", "mesh"],
)
def test_a_sleeping_body_falls_with_its_ground(
    client: Any, made: Callable[[], HeightMap | TriangleMesh], drop: float, every: int, maximal: bool
) -> None:
    """Whichever step the map comes in; it may fall asleep between two updates."""
    terrain, body = made(), put(client, Box(0.3, 0.3, 0.3), (0.0, 0.0, 0.16), useMaximalCoordinates=maximal)
    ground = Ground(client, terrain)
    client.changeDynamics(body, -1, activationState=pb.ACTIVATION_STATE_ENABLE_SLEEPING)
    ground.attach(body)
    step = 0
    while step == 0 or any(map(any, client.getBaseVelocity(body))):
        step = run(client, ground, step, 60, every)
        assert step < 6000, "it does not fall asleep"
    before = height(client, body)
    time = step * DT + 100.0  # long after: no velocity
    if isinstance(terrain, HeightMap):
        terrain.replace(np.full(terrain.heights.shape, -drop), time=time)
    else:
        terrain.move(terrain.vertices - (0.0, 0.0, drop), time=time)
    run(client, ground, step, 240, every)
    assert height(client, body) == pytest.approx(before - drop, abs=2e-3 if drop > 0.01 else 5e-4)
