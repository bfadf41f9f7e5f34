"""Colliders agree with the terrain and are touched only when they must be."""

from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import Ground, HeightMap, InputError, PatchConfig, Sphere
from smartmesh_ros.ground import map_contacts
from smartmesh_ros.patches.config import PatchKind
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import height, put
from tests.core import mesh_parts
from tests.grounds import level
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0
BALL = Sphere(0.2)
START = (0.0, 0.0, 0.5)  # of a ball that falls to the ground


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -3.0])
@pytest.mark.parametrize("radius", [0.2, 0.6, 1.5])
def test_the_collider_has_the_surface_that_sampling_gives(client: Any, yaw: float, radius: float) -> None:
    """The diagonal of the cells is the same on both sides: on rough ground the other one is off by decimetres."""
    rng = np.random.default_rng(7)
    heightmap = HeightMap(rng.uniform(-0.5, 0.5, (60, 70)), resolution=0.2, origin=(1.0, 2.0, 0.7), yaw=yaw)
    middle = heightmap.geometry.to_world(30.3, 33.2)
    surface = float(heightmap.at([middle], 0.0).heights[0])
    body = put(client, Sphere(radius), (*middle, surface + 0.5 * radius))  # halfway in, so that it touches much
    ground = Ground(client, heightmap, PatchConfig(kind="heightfield"))
    follower = ground.attach(body)
    assert follower.radius == radius
    ground.update(0.0, DT)
    assert follower.collider is not None
    client.setCollisionFilterGroupMask(follower.collider, -1, 1, -1)  # rays see no patch otherwise
    client.setCollisionFilterGroupMask(body, -1, 0, 0)
    client.performCollisionDetection()
    support = ground.patches.supports[0]
    assert support.stride == 1
    rows = support.row + rng.uniform(0.01, support.rows - 1.01, 200)
    columns = support.column + rng.uniform(0.01, support.columns - 1.01, 200)
    points = heightmap.geometry.to_world(rows, columns)
    expected = heightmap.at(points, 0.0).heights
    hits = client.rayTestBatch([(x, y, 9.0) for x, y in points], [(x, y, -9.0) for x, y in points])
    assert {hit[0] for hit in hits} == {follower.collider}
    np.testing.assert_allclose([hit[3][2] for hit in hits], expected, atol=1e-5)


def test_a_field_is_replaced_only_if_its_shape_changes(client: Any) -> None:
    bumps = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 50)).astype(np.float32)
    heightmap = HeightMap(bumps, resolution=0.1)
    body = put(client, BALL, (2.04, 2.03, 0.2))
    ground = Ground(client, heightmap, PatchConfig(kind="heightfield"))
    ground.attach(body)

    def replaced(time: float) -> int:
        before = ground.contacts.replacements
        ground.update(time, DT)
        return ground.contacts.replacements - before

    assert replaced(0.0) == 1
    assert replaced(0.0) == 0
    heightmap.replace(bumps + 1.0, time=10.0)
    client.resetBasePositionAndOrientation(body, (2.04, 2.03, 1.2), (0, 0, 0, 1))
    assert replaced(10.0) == 0, "the ground rose as it is"
    heightmap.update_region(15, 15, 1.1 - bumps[15:30, 15:30], time=20.0)
    assert replaced(20.0) == 1, "it has another shape"
    heightmap.update_region(40, 40, np.ones((3, 3)), time=21.0)
    assert replaced(21.0) == 0, "the ground changed elsewhere"


@pytest.mark.parametrize("kind", ["heightfield", "trimesh", "hull", "prisms"])
def test_a_patch_collides_with_its_own_body_only(client: Any, kind: PatchKind) -> None:
    client.setGravity(0, 0, -9.81)
    heightmap = HeightMap(np.zeros((50, 50)), resolution=0.1)
    followed, other = put(client, BALL, (2.0, 2.0, 0.2)), put(client, Sphere(0.05), (2.0, 2.26, 0.05))
    ground = Ground(client, heightmap, PatchConfig(kind=kind))
    ground.attach(followed)
    for step in range(120):
        ground.update(step * DT, DT)
        client.stepSimulation()
    assert height(client, followed) == pytest.approx(0.2, abs=1e-3)
    assert height(client, other) < -0.5


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


def test_ground_that_rises_carries_a_body_in_the_users_own_steps(client: Any) -> None:
    heightmap, body = level(), put(client, BALL, (0.0, 0.0, 0.2))
    ground = Ground(client, heightmap)
    ground.attach(body)
    for step in range(240):
        if step % 4 == 0:
            heightmap.replace(np.full((41, 41), 0.5 * step * DT), time=step * DT)
        client.stepSimulation()
    assert height(client, body) == pytest.approx(0.2 + 0.5, abs=1e-3)


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
        assert put(client, BALL, START) == body
        if attached:
            ground.attach(body)
        for step in range(1, 240):
            ground.step(step * DT, DT)
        assert (height(client, body) > 0.0) == attached
        assert len(ground.followers) == attached
        assert client.getNumBodies() == 1 + attached


def test_without_the_core_bodies_stand_on_colliders_of_pybullet(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_contacts, "misread", lambda: "contacts")
    ground = Ground(client, level())
    assert ground.no_proxies == "the core was built for another PyBullet: the two differ in contacts"
    require_standing(client, ground, 1e-3)
    assert not ground.exact


def test_meshes_of_several_parts_are_ground_for_contacts_from_the_map_alone(client: Any) -> None:
    ground = Ground(client, TriangleMesh(*mesh_parts.joined(mesh_parts.sheet(6.0, 1), mesh_parts.sheet(1.0, 3))))
    with pytest.raises(InputError, match="parts"):
        ground.configure(PatchConfig(kind="heightfield"))
    ground.attach(put(client, BALL, START))
    ground.step(0.0, DT)
    assert ground.exact
