"""Steps on ground that covers bodies, starts to rise or is nowhere; the guard catches what got below it."""

import math
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Sphere, World
from smartmesh_ros.ground.shapes import Hull, Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import about_y, ground_of, height, put, run
from tests.core import mesh_parts
from tests.ground.scene import Scene
from tests.grounds import level, shaped, world_of
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0
BALL = Sphere(0.02)


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("shape", [Box(0.5, 0.4, 0.02), Cylinder(radius=0.2, height=0.02), Sphere(0.01)])
@pytest.mark.parametrize("cover", [0.015, 0.03])
def test_a_body_that_a_map_covers_is_lifted_onto_it_and_no_higher(
    client: Any, shape: Shape, maximal: bool, cover: float
) -> None:
    """By the shape that Bullet collides."""
    terrain, body = level(), put(client, shape, (0.013, 0.021, 0.01), useMaximalCoordinates=maximal)
    ground, heights = ground_of(client, terrain, body), []
    for step in range(120):
        if step == 60:
            terrain.replace(terrain.heights + cover, time=step * DT + 100.0)  # long after: no velocity
        ground.step(step * DT, DT)
        heights.append(height(client, body))
    assert max(heights) == pytest.approx(cover + 0.01, abs=1e-3)
    assert heights[-1] == pytest.approx(cover + 0.01, abs=1e-4)


@pytest.mark.parametrize("maximal", [False, True])
def test_what_stands_astride_a_peak_is_above_the_ground(client: Any, maximal: bool) -> None:
    """The middle of a table, or of the box around a hull on its tip, may be inside the peak."""
    on_tip = Hull(((-0.5, -0.5, 0.0), (-0.5, -0.5, 0.8), (0.5, -0.5, 0.8), (-0.5, 0.5, 0.8)))
    legs = [(x, y, -0.35) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    table = client.createCollisionShapeArray(
        shapeTypes=[pb.GEOM_BOX] * 5,
        halfExtents=[(0.5, 0.5, 0.03)] + [(0.03, 0.03, 0.35)] * 4,
        collisionFramePositions=[(0.0, 0.0, 0.0), *legs],
    )
    standing = client.createMultiBody(1.0, table, basePosition=(0.0, 0.0, 0.701), useMaximalCoordinates=maximal)
    ground = ground_of(client, shaped(lambda x, y: np.where(np.hypot(x, y) < 0.05, 0.5, 0.0)), standing)
    run(ground, 120)
    assert height(client, standing) == pytest.approx(0.7, abs=1e-4)
    ground.attach(put(client, on_tip, (0.0, 0.0, 0.01), useMaximalCoordinates=maximal))
    ground.update(ground.clock, DT)
    assert ground.rescues == 0
    client.resetBasePositionAndOrientation(standing, (0.0, 0.0, -0.3), (0.0, 0.0, 0.0, 1.0))
    ground.update(ground.clock, DT)
    assert ground.rescues == 1


@pytest.mark.parametrize("speed", [0.0, 8.0])
def test_what_is_lifted_keeps_what_it_moves_with_on_the_ground(client: Any, speed: float) -> None:
    """Not faster than 5 m/s relative to the ground, which slides."""
    terrain = level(401)
    terrain.slide((8.0, 0.0), 100.0)
    body = put(client, Box(0.4, 0.4, 0.1), (0.0, 0.0, -1.0))
    client.resetBaseVelocity(body, (speed, 0.0, 0.0))
    ground = ground_of(client, terrain, body)
    ground.update(0.0, DT)
    assert ground.rescues == 1
    velocity, _ = client.getBaseVelocity(body)
    assert velocity == pytest.approx((max(speed, 3.0), 0.0, 0.0))


def test_a_body_that_is_nowhere_disturbs_no_other(client: Any) -> None:
    lost, fine = put(client, BALL, (0.013, 0.021, 0.5)), put(client, BALL, (0.013, 0.021, 0.3))
    client.resetBasePositionAndOrientation(lost, (math.nan, 0.0, 0.0), (0, 0, 0, 1))
    run(ground_of(client, level(), lost, fine))
    assert height(client, fine) == pytest.approx(0.02, abs=1e-3)


def test_ground_of_a_mesh_above_a_body_counts_only_where_there_is_none_below_it(client: Any) -> None:
    floor, top = mesh_parts.sheet(4.0, 1), mesh_parts.box((-0.5, -0.5, 0.5), (0.5, 0.5, 0.6))
    body = put(client, Sphere(0.1), (0.0, 0.0, 9.0))
    ground = ground_of(client, TriangleMesh(*mesh_parts.joined(floor, top)), body)

    def lift(x: float, z: float) -> float:
        client.resetBasePositionAndOrientation(body, (x, 0.2, z), (0.0, 0.0, 0.0, 1.0))
        ground.update(0.0, DT)
        return height(client, body) - z

    for z in (0.7, 0.55, 0.3):  # over the box, in it, and under it
        assert lift(0.1, z) == 0.0
    assert lift(0.1, -0.2) == pytest.approx(0.6 + 0.3)
    assert lift(1.0, -0.2) == pytest.approx(0.3)
    assert lift(3.0, -0.2) == 0.0
    assert ground.rescues == 2
    for nowhere in ((math.nan, -0.2), (math.inf, -0.2), (0.1, math.nan)):
        lift(*nowhere)
    assert ground.rescues == 2


def test_a_users_own_steps_are_those_of_the_ground() -> None:
    """Equal to the bit: bodies that a map covers are lifted, corrections move others, and they sleep and wake."""
    mine, theirs = Scene(), Scene()
    found = mine.run(720, by_pybullet=True)
    np.testing.assert_array_equal(found, theirs.run(720))
    asleep = found[:, -1 - len(mine.bodies) : -1].astype(bool)
    assert mine.ground.rescues == theirs.ground.rescues >= 4
    assert asleep.any(axis=0).sum() >= 6 and (asleep[:-1] & ~asleep[1:]).any(axis=0).sum() >= 4
    for scene in (mine, theirs):
        scene.client.disconnect()


def test_sub_steps_of_pybullet_are_steps_of_their_own(client: Any) -> None:
    """On ground that heaves, each at its own instant."""
    found = []
    for sub_steps in (1, 4):
        client.resetSimulation()
        client.setGravity(0.0, 0.0, -9.81)
        client.setTimeStep(sub_steps * DT / 4.0)
        client.setPhysicsEngineParameter(numSubSteps=sub_steps)
        terrain = level()
        bodies = [put(client, shape, (0.3 * k, 0.0, 0.11)) for k, shape in enumerate((Sphere(0.1), Box(0.2, 0.2, 0.2)))]
        ground = ground_of(client, terrain, *bodies)
        for step in range(240):
            terrain.replace(np.full((41, 41), 0.1 * math.sin(2.0 * math.pi * step * DT)), time=step * DT)
            for sub in range(4 // sub_steps):
                ground.step((step + 0.25 * sub) * DT, 0.25 * sub_steps * DT)
        found.append([height(client, body) for body in bodies])
    np.testing.assert_allclose(found[1], found[0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("put_another", [True, False])
def test_other_ground_of_the_next_episode_throws_nobody(client: Any, put_another: bool) -> None:
    """Another map in the place of the last one, or heights that came there with no velocity."""
    rng = np.random.default_rng(1)
    terrain, body = level(), put(client, BALL, (0.0, 0.0, 0.02))
    ground = ground_of(client, terrain, body)
    for _ in range(20):
        at = float(rng.uniform(-0.5, 0.5))
        if put_another:
            ground.terrain.put("", shaped(lambda x, y, at=at: at))
        else:
            terrain.replace(np.full((41, 41), at), time=ground.clock, velocities=np.zeros((41, 41)))
        client.resetBasePositionAndOrientation(body, (0.0, 0.0, at + BALL.radius), (0.0, 0.0, 0.0, 1.0))
        run(ground, 24)
        assert height(client, body) == pytest.approx(at + BALL.radius, abs=1e-4)
    assert ground.rescues == 0


BARBELL = robot(
    link("near", moment=0.1), link("far", '<sphere radius="0.2"/>', moment=0.1),
    joint("rod", "fixed", "near", "far", xyz="1 0 0"),
)  # fmt: skip


@pytest.mark.parametrize("heights", [(0.0, 0.8), (0.8, 0.0)])
def test_the_guard_puts_back_a_robot_with_all_its_links(heights: tuple[float, float]) -> None:
    """Slowed. Two links in ground of two heights: both are out of it at once, and the robot counts as one."""
    with World(shaped(lambda x, y: np.where(x < 0.0, *heights), 51)) as world:
        world.spawn_robot("barbell", BARBELL, BodyState((-0.5, 0.0, -0.05), linear=(30.0, 0.0, 0.0)))
        world.spawn("fine", Sphere(0.2), 1.0, BodyState((1.0, 1.0, 1.2)))
        world.update()
        assert world.rescues == 1
        assert math.hypot(*world.state("barbell").linear) <= 5.1
        assert world.below_ground() == []
        lift = world.state("barbell").position[2] + 0.05
        assert lift == pytest.approx(0.85 + (0.1 if heights[0] else 0.2), abs=0.02)


def test_the_guard_leaves_who_crosses_a_ridge_and_finds_at_once_who_is_below_it() -> None:
    with World(shaped(lambda x, y: -np.abs(y), 21, 2.0)) as world:
        world.spawn("ball", Sphere(0.5), 1.0, BodyState((0.0, -0.5, 0.6)))
        uid = world.bodies["ball"].uid
        for y in np.linspace(-0.5, 0.8, 200):  # over the ridge, and below the plane that was up to then under it
            world.client.resetBasePositionAndOrientation(uid, (0.0, y, 0.55 - abs(y)), (0, 0, 0, 1))
            world.update()
        assert world.rescues == 0
        world.client.resetBasePositionAndOrientation(uid, (0.0, 0.8, -0.9), (0, 0, 0, 1))
        world.update()
        assert world.rescues == 1


def lying(slope: float) -> BodyState:
    """A cylinder that is 0.1 m high, just above a slope."""
    angle = math.atan(slope)
    return BodyState((-0.0501 * math.sin(angle), 0.0, 0.0501 * math.cos(angle)), about_y(-angle))


BOX, CYLINDER, SIDE = Box(0.3, 0.3, 0.3), Cylinder(radius=0.15, height=0.1), 41
ROUGH = np.random.default_rng(3).normal(scale=0.02, size=(SIDE, SIDE))
SLOPE = np.tile(0.3 * (0.1 * np.arange(SIDE) - 2.0), (SIDE, 1))
ON_ROUGH = BodyState((0.0, 0.0, float(ROUGH.max()) + 0.15))


@pytest.mark.parametrize(
    ("shape", "start", "heights", "speed", "lowest"),
    [
        (BOX, BodyState((0.0, 0.0, 0.15)), 0.0 * ROUGH, 1.0, -1e-4),
        (BOX, BodyState((0.0, 0.0, 0.15)), 0.0 * ROUGH, 5.0, -1e-4),
        (BOX, ON_ROUGH, ROUGH, 2.0, -0.01),
        (BOX, ON_ROUGH, ROUGH, 5.0, -0.01),
        (CYLINDER, lying(0.0), 0.0 * ROUGH, 1.5, -1e-3),
        (CYLINDER, lying(0.3), SLOPE, 1.5, -1e-3),
    ],
)
def test_a_body_at_rest_rides_on_ground_that_starts_to_rise_at_once(
    shape: Shape, start: BodyState, heights: np.ndarray, speed: float, lowest: float
) -> None:
    """And is not thrown: at most 1 mm above where it would ride, in each step of a second."""
    still = np.zeros((SIDE, SIDE))
    heightmap = HeightMap(heights, resolution=0.1, origin=(-2.0, -2.0), velocities=still)
    # After sleep, contacts of a cylinder take some steps to form anew.
    with world_of(heightmap, sleep=shape is BOX) as world:
        world.spawn("body", shape, 1.0, start)
        world.step(240)
        rest, found = world.state("body").position[2], []
        for step in range(240):
            if step % 4 == 0:
                heightmap.replace(heights + speed * step * DT, time=1.0 + step * DT, velocities=still + speed)
            world.step()
            found.append(world.state("body").position[2] - rest - speed * (step + 1) * DT)
        assert max(found) <= 1e-3
        assert min(found) >= lowest
