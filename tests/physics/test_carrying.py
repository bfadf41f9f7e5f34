"""Colliders are where the ground's motion takes them, also those that PyBullet has lower."""

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.physics.carrying import Carried

STEP = 1.0 / 240.0


@pytest.mark.parametrize("depth", [0.0, 0.08])
def test_a_collider_turns_about_its_surface_however_low_it_is(depth: float) -> None:
    twist = np.array([[0.3, -0.2, 0.5, 0.9, -0.7, 0.0]])
    client, one = BulletClient(pb.DIRECT), np.array([0])
    client.setTimeStep(STEP)
    shape = client.createCollisionShape(pb.GEOM_BOX, halfExtents=[0.5] * 3)
    carried = Carried(client)
    carried.adopt(np.array([-1]))
    carried.colliders[0], carried.depths[0], carried.times[0] = client.createMultiBody(0.0, shape), depth, 0.0
    carried.place(one, np.array([[1.0, 2.0, 3.0]]), (0.0, 0.0, 0.0, 1.0))
    carried.push(one, twist, 0.0, np.zeros(1))
    client.stepSimulation()
    turn = carried.advance(one, STEP)
    assert turn == pytest.approx(twist[:, 3:] * STEP)
    assert carried.bases[0] == pytest.approx([1.0, 2.0, 3.0] + twist[0, :3] * STEP)
    position, orientation = client.getBasePositionAndOrientation(carried.colliders[0])
    surface, _ = client.multiplyTransforms(position, orientation, [0.0, 0.0, depth], [0.0, 0.0, 0.0, 1.0])
    # What is left is of second order: the turn times the way, also that of a body so much lower.
    second = np.linalg.norm(turn) * (np.linalg.norm(twist[0, :3]) * STEP + np.linalg.norm(turn) * depth)
    assert np.linalg.norm(carried.bases[0] - surface) < second + 1e-6
    client.disconnect()
