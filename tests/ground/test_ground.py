"""Bodies are attached to the ground of a client, which has one at a time."""

from collections.abc import Callable
from typing import Any

import pybullet as pb
import pybullet_data
import pytest

from smartmesh_ros import Ground, InputError, Sphere
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import ground_of, height, put, run
from tests.core import mesh_parts
from tests.grounds import level
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0
BALL = Sphere(0.2)
START = (0.0, 0.0, 0.5)  # of a ball that falls to the ground


@pytest.fixture
def car(client: Any, tmp_path: Any) -> int:
    base = [link("base_footprint", "", None), link("base_link", '<box size="0.5 0.3 0.1"/>', 5.0, 0.1)]
    base.append(joint("up", "fixed", "base_footprint", "base_link", xyz="0 0 0.1"))
    for n, (x, y) in enumerate((x, y) for x in (0.2, -0.2) for y in (0.2, -0.2)):
        wheel = link(f"wheel{n}", '<cylinder radius="0.1" length="0.05"/>', 0.5, 0.001, rpy="1.570796 0 0")
        base += [wheel, joint(f"axle{n}", "continuous", "base_link", f"wheel{n}", xyz=f"{x} {y} -0.03")]
    (tmp_path / "car.urdf").write_text(robot(*base))
    return int(client.loadURDF(str(tmp_path / "car.urdf"), (0.5, 0.2, 0.05), flags=pb.URDF_USE_IMPLICIT_CYLINDER))


def test_a_robot_is_attached_with_all_links_that_have_a_shape(client: Any, car: int) -> None:
    """It stands on its wheels; its root has no shape."""
    ground = Ground(client, level())
    first = ground.attach(car)
    links = [ground.followers[slot].link for slot in ground.followers.of(car)]
    assert links == [0, 1, 2, 3, 4]
    assert first.link == 0
    run(ground, 480)
    assert client.getLinkState(car, 0)[0][2] == pytest.approx(0.13, abs=2e-3)
    assert ground.rescues == 0
    ground.detach(car)
    assert not ground.followers.of(car)


def test_what_cannot_be_attached_is_refused_whole(client: Any, car: int) -> None:
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    soft = client.loadSoftBody("bunny.obj", basePosition=(0, 0, 1), mass=0.1, useMassSpring=1)
    ground, ghost, ball = Ground(client, level()), client.createMultiBody(1.0), put(client, BALL, START)
    bodies = client.getNumBodies()
    refused: list[tuple[int, dict[str, Any], str]] = [
        (car, {"link": -1}, r"base_footprint.*0 'base_link'.*1 'wheel0'.*4 'wheel3'"),
        (ghost, {}, "no collision shape"),
        (ball, {"radius": -1.0}, "radius"),
        (soft, {}, "it is soft, and only rigid bodies and robots collide with the map"),
        (soft, {"radius": 0.1}, "it is soft"),
    ]
    for body, given, words in refused:
        with pytest.raises(InputError, match=words):
            ground.attach(body, **given)
    assert not len(ground.followers)
    assert client.getNumBodies() == bodies
    ground.attach(car, 2)
    for link_number in (None, 2):
        with pytest.raises(InputError, match="link 2 is attached already"):
            ground.attach(car, link_number)
    assert len(ground.followers) == 1


def require_standing(client: Any, ground: Ground) -> None:
    """Assert that a ball falls to the ground, which is new, and stands on it."""
    assert ground.clock == 0.0
    body = put(client, BALL, START)
    ground.attach(body)
    run(ground, 480)
    assert height(client, body) == pytest.approx(0.2, abs=1e-4)


def test_a_client_has_one_ground_at_a_time(client: Any) -> None:
    first = ground_of(client, level(), put(client, BALL, (1.0, 0.0, 0.5)))
    client.stepSimulation()
    with pytest.raises(InputError, match="has a ground already"):
        Ground(client, level())
    first.close()
    require_standing(client, Ground(client, level()))


def test_a_client_that_was_reset_is_named_in_each_refusal_and_takes_a_new_ground(client: Any) -> None:
    ground = ground_of(client, level(), put(client, BALL, START))
    ground.show()
    client.stepSimulation()
    client.resetSimulation()
    ball = put(client, BALL, (1.0, 0.0, 0.5))
    asked: tuple[Callable[[], object], ...] = (
        lambda: ground.attach(ball), lambda: ground.step(DT, DT), lambda: ground.clock, lambda: ground.rescues,
        lambda: ground.is_asleep(0), lambda: ground.find_patches(0.0), ground.show,
    )  # fmt: skip
    for ask in asked:
        with pytest.raises(InputError, match="client was reset or closed: close this ground, and make another"):
            ask()
    assert client.getNumBodies() == 1
    client.stepSimulation()
    ground.close()
    assert not ground.shown
    client.setGravity(0.0, 0.0, -9.81)
    require_standing(client, Ground(client, level()))


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
    """The next body gets its number from PyBullet: it stands on the ground if it is attached."""
    body = put(client, BALL, START)
    ground = ground_of(client, level(), body)
    ground.step(0.0, DT)
    for attached in (False, True):
        client.removeBody(body)
        ground.wake(body)  # nobody
        assert put(client, BALL, START) == body
        if attached:
            ground.attach(body)
        run(ground)
        assert (height(client, body) > 0.0) == attached
        assert len(ground.followers) == attached
        assert client.getNumBodies() == 1 + attached
