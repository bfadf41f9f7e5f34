"""Bodies, as PyBullet makes and changes them, are attached to the ground of a client, which has one at a time."""

import gc
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import Ground, InputError, Soil, Sphere
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import ground_of, height, put, run
from tests.core import mesh_parts
from tests.grounds import level
from tests.memory import allocated
from tests.urdfs import HUSKY

DT = 1.0 / 240.0
BALL = Sphere(0.2)
START = (0.0, 0.0, 0.5)  # of a ball that falls to the ground


def test_a_robot_is_attached_with_all_links_that_have_a_shape(client: Any) -> None:
    """It stands on its wheels; its root and its other links have no shape."""
    ground, husky = Ground(client, level()), client.loadURDF(HUSKY, (0.5, 0.2, 0.05))
    first = ground.attach(husky)
    links = [ground.followers[slot].link for slot in ground.followers.of(husky)]
    assert links == [0, 2, 3, 4, 5]
    assert first.link == 0
    run(ground, 480)
    assert client.getLinkState(husky, 0)[4][2] == pytest.approx(0.145, abs=2e-3)
    assert ground.rescues == 0
    ground.detach(husky)
    assert not ground.followers.of(husky)


def test_what_cannot_be_attached_is_refused_whole(client: Any) -> None:
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    soft = client.loadSoftBody("bunny.obj", basePosition=(0, 0, 1), mass=0.1, useMassSpring=1)
    husky, ghost, ball = client.loadURDF(HUSKY), client.createMultiBody(1.0), put(client, BALL, START)
    duck = client.createCollisionShape(client.GEOM_MESH, fileName="duck.obj", flags=client.GEOM_FORCE_CONCAVE_TRIMESH)
    moving, standing = (client.createMultiBody(mass, duck, basePosition=START) for mass in (1.0, 0.0))
    links = client.loadURDF("r2d2.urdf", useMaximalCoordinates=True)
    ground, bodies = Ground(client, level()), client.getNumBodies()
    refused: list[tuple[int, dict[str, Any], str]] = [
        (husky, {"link": -1}, r"base_footprint.*0 'base_link'.*2 'front_left_wheel_link'.*5 'rear_right_wheel_link'"),
        (ghost, {}, "no collision shape"),
        (ball, {"radius": -1.0}, "radius"),
        (soft, {}, "it is soft, and only rigid bodies and robots collide with the map"),
        (soft, {"radius": 0.1}, "it is soft"),
        (links, {}, "bodies without numbers.*load the robot without useMaximalCoordinates"),
        (links, {"link": -1, "radius": 0.1}, "bodies without numbers"),
        (moving, {}, "not convex, and only convex ones collide with the map; load the mesh without"),
    ]
    for body, given, words in refused:
        with pytest.raises(InputError, match=words):
            ground.attach(body, **given)
    assert not len(ground.followers)
    assert client.getNumBodies() == bodies
    ground.attach(husky, 2)
    for link_number in (None, 2):
        with pytest.raises(InputError, match="link 2 is attached already"):
            ground.attach(husky, link_number)
    ground.attach(standing)
    ground.attach(moving, solid=False)
    assert len(ground.followers) == 3


def test_a_client_that_was_reset_is_named_in_each_refusal_and_takes_a_new_ground(client: Any) -> None:
    ground = ground_of(client, level(), put(client, BALL, START))
    ground.show()
    client.stepSimulation()
    client.resetSimulation()
    ball = put(client, BALL, (1.0, 0.0, 0.5))
    asked: tuple[Callable[[], object], ...] = (
        lambda: ground.attach(ball), lambda: ground.step(DT, DT), lambda: ground.clock, lambda: ground.rescues,
        lambda: ground.is_asleep(0), lambda: ground.find_patches(0.0), ground.show,
        lambda: ground.set_soil(Soil(ground.terrain, "clay")), lambda: ground.drive(0, -1, (0.0, 1.0, 0.0), 0.3),
    )  # fmt: skip
    for ask in asked:
        with pytest.raises(InputError, match="client was reset or closed: close this ground, and make another"):
            ask()
    assert not any(follower.belt.speed for follower in ground.followers)
    assert client.getNumBodies() == 1
    client.stepSimulation()
    ground.close()
    assert not ground.shown and ground.soil is None
    client.setGravity(0.0, 0.0, -9.81)
    body = put(client, BALL, START)
    other = ground_of(client, level(), body)
    assert other.clock == 0.0
    run(other, 480)
    assert height(client, body) == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("terrain", [level(), TriangleMesh(*mesh_parts.sheet(6.0, 1))], ids=["map", "mesh"])
def test_a_collision_query_between_steps_finds_the_ground(client: Any, terrain: Any, maximal: bool) -> None:
    """Of bodies where their user put them since the last step, or before the first."""
    bodies = [put(client, BALL, (x, 0.3, 0.5), useMaximalCoordinates=maximal) for x in (0.0, 1.0)]
    ground = ground_of(client, terrain, *bodies)
    for depth in (0.0, 0.05, 0.01):
        client.resetBasePositionAndOrientation(bodies[0], (0.7, -0.5, BALL.radius - depth), (0, 0, 0, 1))
        client.performCollisionDetection()
        assert [point[8] for point in client.getContactPoints(bodies[0])] == pytest.approx([-depth])
        assert not client.getContactPoints(bodies[1])
        run(ground, 10 if depth else 0)


def test_a_body_that_is_removed_without_a_word_is_taken_off_the_ground(client: Any) -> None:
    """The next body gets its number from PyBullet: it stands on the ground if it is attached. Else it never sleeps, as
    who is not there."""
    body = put(client, BALL, START)
    ground = ground_of(client, level(), body)
    ground.step(0.0, DT)
    for attached in (False, True):
        client.removeBody(body)
        ground.wake(body)  # nobody
        assert put(client, BALL, START) == body
        if attached:
            ground.attach(body)
        assert not ground.is_asleep(body) and not ground.is_asleep(99)
        run(ground)
        assert (height(client, body) > 0.0) == attached
        assert len(ground.followers) == attached
        assert client.getNumBodies() == 1 + attached


@pytest.mark.parametrize("cleared", [False, True])
def test_a_piece_of_ground_that_is_removed_is_put_back(
    client: Any, caplog: pytest.LogCaptureFixture, cleared: bool
) -> None:
    """And told; unless the body is removed as well, as by who clears the whole world."""
    body = put(client, BALL, START)
    ground = ground_of(client, level(), body)
    follower = ground.followers.at(body, -1)
    assert follower is not None and follower.collider is not None
    client.removeBody(follower.collider)
    assert not ground.is_ground(follower.collider)
    assert not any(map(ground.is_ground, ("x", 1.5, None, 10**30, -(10**30))))
    other = put(client, BALL, (1.0, 0.0, BALL.radius))  # gets the number
    assert other == follower.collider
    if cleared:
        client.removeBody(body)
    else:
        ground.attach(other)
    run(ground)
    assert client.getNumBodies() == (1 if cleared else 4)
    assert [each.body for each in ground.followers] == ([] if cleared else [body, other])
    assert ("the ground under body 0 was removed" in caplog.text) == (not cleared)
    if not cleared:
        assert height(client, body) == pytest.approx(BALL.radius, abs=1e-3)
    ground.detach(body)
    assert client.getNumBodies() == (1 if cleared else 3)


def test_all_bodies_of_a_batch_stand_on_the_ground(client: Any) -> None:
    """PyBullet's client knows only the last one before ``syncBodyInfo``."""
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=0.2)
    places = [(x, 0.0, 0.3) for x in (-1.0, 0.0, 1.0)]
    bodies = client.createMultiBody(1.0, shape, batchPositions=places, useMaximalCoordinates=True)
    run(ground_of(client, level(), *bodies), 120)
    assert [height(client, body) for body in bodies] == pytest.approx([0.2] * 3, abs=1e-3)


def test_a_body_that_got_its_mass_after_it_was_attached_is_lifted_out_of_the_ground(client: Any) -> None:
    ball, patched = put(client, BALL, (0.0, 0.0, 0.3)), put(client, BALL, (1.0, 0.0, -1.0))
    client.changeDynamics(ball, -1, mass=0.0)
    ground = ground_of(client, level(), ball)
    ground.attach(patched, solid=False)
    client.resetBasePositionAndOrientation(ball, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0))
    run(ground, 2)
    assert (height(client, ball), ground.rescues) == (-1.0, 0), "what has no mass stays where it was put"
    assert height(client, patched) < -1.0, "what is not solid falls on"
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
