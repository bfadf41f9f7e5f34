"""Grounds in PyBullet worlds of a user's own: bodies as PyBullet makes and changes them, and grounds that end."""

import gc
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import Ground, Sphere
from tests.bodies import ground_of, height, put, run
from tests.grounds import level
from tests.memory import allocated

BALL = Sphere(0.2)


def test_all_bodies_of_a_batch_stand_on_the_ground(client: Any) -> None:
    """PyBullet's client knows only the last one before ``syncBodyInfo``."""
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=0.2)
    places = [(x, 0.0, 0.3) for x in (-1.0, 0.0, 1.0)]
    bodies = client.createMultiBody(1.0, shape, batchPositions=places, useMaximalCoordinates=True)
    run(ground_of(client, level(), *bodies), 120)
    assert [height(client, body) for body in bodies] == pytest.approx([0.2] * 3, abs=1e-3)


def test_a_body_that_got_its_mass_after_it_was_attached_is_lifted_out_of_the_ground(client: Any) -> None:
    ball = put(client, BALL, (0.0, 0.0, 0.3))
    client.changeDynamics(ball, -1, mass=0.0)
    ground = ground_of(client, level(), ball)
    client.resetBasePositionAndOrientation(ball, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0))
    run(ground, 2)
    assert (height(client, ball), ground.rescues) == (-1.0, 0), "what has no mass stays where it was put"
    client.changeDynamics(ball, -1, mass=1.0)
    run(ground, 60)
    assert height(client, ball) == pytest.approx(0.2, abs=1e-3) and ground.rescues == 1


@pytest.mark.parametrize("how", ["mask", "pair"])
def test_a_body_that_pybullet_keeps_from_the_ground_falls_through_it(client: Any, how: str) -> None:
    ball = put(client, BALL, (0.0, 0.0, 0.2))
    ground = ground_of(client, level(), ball)
    run(ground, 10)
    if how == "mask":
        client.setCollisionFilterGroupMask(ball, -1, 0, 0)
    else:
        [proxy] = {contact[2] for contact in client.getContactPoints(ball)}
        client.setCollisionFilterPair(ball, proxy, -1, -1, 0)
    run(ground, 240)
    assert height(client, ball) < -4.0 and ground.rescues == 0


def test_what_is_not_attached_is_not_asleep(client: Any) -> None:
    ground = ground_of(client, level())
    assert not ground.is_asleep(put(client, BALL, (0.0, 0.0, 0.3))) and not ground.is_asleep(99)


def test_a_ground_that_was_dropped_leaves_nothing_in_the_way_of_bodies_and_rays(client: Any) -> None:
    ball = put(client, BALL, (0.0, 0.0, 0.2))
    ground = ground_of(client, level(), ball)
    run(ground, 10)
    del ground
    gc.collect()
    client.resetBasePositionAndOrientation(ball, (3.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert client.rayTest((0.0, 0.0, 1.0), (0.0, 0.0, -1.0))[0][0] == -1
    other = put(client, BALL, (0.0, 0.0, 0.5))
    for _ in range(240):
        client.stepSimulation()
    assert height(client, other) < -3.0
    client.removeBody(ball)
    client.resetSimulation()
    client.stepSimulation()


def test_a_ground_that_is_saved_while_it_is_shown_takes_no_memory_each_time(client: Any) -> None:
    """PyBullet itself keeps every height field and texture that was ever made."""
    ground = Ground(client, level())
    ground.show()
    used = []
    for count in (2, 10):
        for _ in range(count):
            ground.restore_state(ground.save_state())
        used.append(allocated())
    assert used[1] - used[0] < 10 * 100e3
    assert np.isfinite(client.rayTest((0.0, 0.0, 1.0), (0.0, 0.0, -1.0))[0][2])
