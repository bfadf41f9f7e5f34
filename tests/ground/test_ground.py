"""Colliders agree with the terrain and are touched only when they must be."""

from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.patches.config import PatchConfig, PatchKind
from smartmesh_ros.terrain.heightmap import HeightMap
from tests.urdfs import inertial, joint, link, robot

DT = 1.0 / 240.0


def sphere(client: Any, position: tuple[float, float, float], radius: float = 0.3) -> int:
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=radius)
    return int(client.createMultiBody(1.0, shape, basePosition=position))


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -3.0])
@pytest.mark.parametrize("radius", [0.2, 0.6, 1.5])
def test_the_collider_has_the_surface_that_sampling_gives(client: Any, yaw: float, radius: float) -> None:
    """The diagonal of the cells is the same on both sides: on rough ground the other one is off by decimetres."""
    rng = np.random.default_rng(7)
    heightmap = HeightMap(rng.uniform(-0.5, 0.5, (60, 70)), resolution=0.2, origin=(1.0, 2.0, 0.7), yaw=yaw)
    middle = heightmap.geometry.to_world(30.3, 33.2)
    height = float(heightmap.at([middle], 0.0).heights[0])
    body = sphere(client, (*middle, height + 0.5 * radius), radius)  # halfway in, so that it touches much
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
    body = sphere(client, (2.04, 2.03, 0.2), 0.2)
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
    followed, other = sphere(client, (2.0, 2.0, 0.3)), sphere(client, (2.0, 2.36, 0.05), radius=0.05)
    ground = Ground(client, heightmap, PatchConfig(kind=kind))
    ground.attach(followed)
    for step in range(120):
        ground.update(step * DT, DT)
        client.stepSimulation()
    assert client.getBasePositionAndOrientation(followed)[0][2] == pytest.approx(0.3, abs=1e-3)
    assert client.getBasePositionAndOrientation(other)[0][2] < -0.5


def test_bad_attachments_are_refused(client: Any) -> None:
    ground = Ground(client, HeightMap(np.zeros((5, 5))))
    body = sphere(client, (2.0, 2.0, 1.0))
    ground.attach(body)
    with pytest.raises(InputError, match="attached already"):
        ground.attach(body)
    with pytest.raises(InputError, match="radius"):
        ground.attach(sphere(client, (3.0, 2.0, 1.0)), radius=-1.0)


WHEEL = f"""<link name="wheel{{}}">{inertial(0.5, 0.001)}<collision><origin rpy="1.570796 0 0"/><geometry>
<cylinder radius="0.1" length="0.05"/></geometry></collision></link>"""


@pytest.fixture
def car(client: Any, tmp_path: Any) -> int:
    base = [link("base_footprint", "", None), link("base_link", '<box size="0.5 0.3 0.1"/>', 5.0, 0.1)]
    base.append(joint("up", "fixed", "base_footprint", "base_link", xyz="0 0 0.1"))
    for n, (x, y) in enumerate((x, y) for x in (0.2, -0.2) for y in (0.2, -0.2)):
        base += [WHEEL.format(n), joint(f"axle{n}", "continuous", "base_link", f"wheel{n}", xyz=f"{x} {y} -0.03")]
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
