"""Colliders agree with the terrain and are touched only when they must be."""

from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import Ground, HeightMap, InputError, Sphere
from smartmesh_ros.ground import map_contacts
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import height, put
from tests.core import mesh_parts
from tests.grounds import level
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0
BALL = Sphere(0.2)
START = (0.0, 0.0, 0.5)  # of a ball that falls to the ground


def test_bad_attachments_are_refused(client: Any) -> None:
    ground = Ground(client, HeightMap(np.zeros((5, 5)), resolution=1.0))
    body = put(client, BALL, (2.0, 2.0, 1.0))
    ground.attach(body)
    with pytest.raises(InputError, match="attached already"):
        ground.attach(body)
    with pytest.raises(InputError, match="radius"):
        ground.attach(put(client, BALL, (3.0, 2.0, 1.0)), radius=-1.0)


@pytest.fixture
def car(client: Any, tmp_path: Any) -> int:
    base = [link("base_footprint", "", None), link("base_link", '<box size="0.5 0.3 0.1"/>', 5.0, 0.1)]
    base.append(joint("up", "fixed", "base_footprint", "base_link", xyz="0 0 0.1"))
    for n, (x, y) in enumerate((x, y) for x in (0.2, -0.2) for y in (0.2, -0.2)):
        wheel = link(f"wheel{n}", '<cylinder radius="0.1" length="0.05"/>', 0.5, 0.001, rpy="1.570796 0 0")
        base += [wheel, joint(f"axle{n}", "continuous", "base_link", f"wheel{n}", xyz=f"{x} {y} -0.03")]
    (tmp_path / "car.urdf").write_text(robot(*base))
    return int(client.loadURDF(str(tmp_path / "car.urdf"), (3.0, 2.0, 0.05), flags=pb.URDF_USE_IMPLICIT_CYLINDER))


def test_a_robot_is_attached_with_all_links_that_have_a_shape(client: Any, car: int) -> None:
    """It stands on its wheels; its root has no shape."""
    client.setGravity(0.0, 0.0, -9.81)
    ground = Ground(client, HeightMap(np.zeros((41, 61)), resolution=0.1))
    first = ground.attach(car)
    links = [ground.followers[slot].link for slot in ground.followers.of(car)]
    assert links == [0, 1, 2, 3, 4]
    assert first.link == 0
    for step in range(480):
        ground.step(step / 240, 1 / 240)
    assert client.getLinkState(car, 0)[0][2] == pytest.approx(0.13, abs=2e-3)
    assert ground.rescues == 0
    ground.detach(car)
    assert not ground.followers.of(car)


def test_a_link_without_a_shape_is_refused_and_the_links_that_have_one_are_named(client: Any, car: int) -> None:
    ground = Ground(client, HeightMap(np.zeros((41, 61)), resolution=0.1))
    with pytest.raises(InputError, match="base_footprint") as error:
        ground.attach(car, -1)
    for name in ("0 'base_link'", "1 'wheel0'", "4 'wheel3'"):
        assert name in str(error.value)
    ghost = client.createMultiBody(1.0)
    with pytest.raises(InputError, match="no collision shape"):
        ground.attach(ghost)
    assert len(ground.followers) == 0


def test_a_robot_one_link_of_which_is_attached_already_is_refused_whole(client: Any, car: int) -> None:
    ground = Ground(client, HeightMap(np.zeros((41, 61)), resolution=0.1))
    ground.attach(car, 2)
    with pytest.raises(InputError, match="link 2 is attached already"):
        ground.attach(car)
    assert len(ground.followers) == 1


def test_a_ground_that_is_gone_leaves_the_world_usable(client: Any) -> None:
    body, ground = put(client, BALL, START), Ground(client, level())
    ground.attach(body)
    ground.step(0.0, DT)
    del ground
    for _ in range(240):
        client.stepSimulation()
    client.removeBody(body)
    client.resetSimulation()
    client.stepSimulation()


def require_standing(client: Any, ground: Ground, within: float = 1e-4) -> None:
    """Assert that a ball falls to the ground and stands on it."""
    body = put(client, BALL, START)
    ground.attach(body)
    for step in range(480):
        ground.step(step * DT, DT)
    assert height(client, body) == pytest.approx(0.2, abs=within)


def test_a_client_has_one_ground_at_a_time(client: Any) -> None:
    first = Ground(client, level())
    first.attach(put(client, BALL, (1.0, 0.0, 0.5)))
    with pytest.raises(InputError, match="has a ground already"):
        Ground(client, level())
    first.close()
    require_standing(client, Ground(client, level()))


def test_a_client_that_was_reset_is_named_and_takes_a_new_ground(client: Any) -> None:
    ground = Ground(client, level())
    ground.attach(put(client, BALL, START))
    client.stepSimulation()
    client.resetSimulation()
    with pytest.raises(InputError, match="the PyBullet client was reset"):
        ground.step(DT, DT)
    client.stepSimulation()
    ground.close()
    client.setGravity(0.0, 0.0, -9.81)
    require_standing(client, Ground(client, level()))


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("terrain", [level(), TriangleMesh(*mesh_parts.sheet(6.0, 1))], ids=["map", "mesh"])
def test_a_collision_query_between_steps_finds_the_ground(client: Any, terrain: Any, maximal: bool) -> None:
    """Of bodies where their user put them since the last step, or before the first."""
    bodies = [put(client, BALL, (x, 0.3, 0.5), useMaximalCoordinates=maximal) for x in (0.0, 1.0)]
    ground = Ground(client, terrain)
    for body in bodies:
        ground.attach(body)
    for depth in (0.05, 0.01):
        client.resetBasePositionAndOrientation(bodies[0], (0.7, -0.5, BALL.radius - depth), (0, 0, 0, 1))
        client.performCollisionDetection()
        assert [point[8] for point in client.getContactPoints(bodies[0])] == pytest.approx([-depth])
        assert not client.getContactPoints(bodies[1])
        for step in range(10):
            ground.step(step * DT, DT)


def test_a_soft_body_is_refused_with_a_sentence(client: Any) -> None:
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    soft = client.loadSoftBody("bunny.obj", basePosition=(0, 0, 1), mass=0.1, useMassSpring=1)
    ground, bodies = Ground(client, level()), client.getNumBodies()
    for given in ({}, {"radius": 0.1}):
        with pytest.raises(InputError, match="it is soft, and only rigid bodies and robots collide with the map"):
            ground.attach(soft, **given)
    assert not len(ground.followers)
    assert client.getNumBodies() == bodies


def test_a_body_that_is_removed_without_a_word_is_taken_off_the_ground(client: Any) -> None:
    """The next body gets its number from PyBullet: it stands on the ground if it is attached."""
    ground, body = Ground(client, level()), put(client, BALL, START)
    ground.attach(body)
    ground.step(0.0, DT)
    for attached in (False, True):
        client.removeBody(body)
        ground.wake(body)  # nobody
        assert put(client, BALL, START) == body
        if attached:
            ground.attach(body)
        for step in range(1, 240):
            ground.step(step * DT, DT)
        assert (height(client, body) > 0.0) == attached
        assert len(ground.followers) == attached
        assert client.getNumBodies() == 1 + attached


def test_a_core_for_another_pybullet_is_refused(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_contacts, "misread", lambda: "contacts")
    with pytest.raises(InputError, match="the core was built for another PyBullet: the two differ in contacts"):
        Ground(client, level())
    assert client.getNumBodies() == 0
