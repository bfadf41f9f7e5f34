"""Contacts worked out from the map itself (``from_map`` of `Ground` and `WorldConfig`)."""

import math
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import (
    BodyState,
    Box,
    Capsule,
    Cylinder,
    Ground,
    HeightMap,
    PatchConfig,
    PhysicsConfig,
    Sphere,
    World,
    WorldConfig,
)
from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.shapes import Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts

DT = 1.0 / 240.0
LYING = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # with its axis along y
SHAPES: list[tuple[Shape, tuple[float, ...], float]] = [
    (Sphere(0.2), (0.0, 0.0, 0.0, 1.0), 0.2),
    (Box(0.4, 0.3, 0.2), (0.0, 0.0, math.sin(0.3), math.cos(0.3)), 0.1),
    (Cylinder(0.1, 0.3), (0.0, 0.0, 0.0, 1.0), 0.15),
    (Cylinder(0.1, 0.3), LYING, 0.1),
    (Capsule(0.1, 0.3), LYING, 0.1),
]


def flat(spacing: float = 0.05, cells: int = 201) -> HeightMap:
    half = 0.5 * spacing * (cells - 1)
    return HeightMap(np.zeros((cells, cells)), resolution=spacing, origin=(-half, -half))


def world_of(ground: HeightMap | TriangleMesh, **physics: Any) -> World:
    world = World(ground, WorldConfig(from_map=True, physics=PhysicsConfig(**physics)))
    world.refresh()
    assert world.ground.exact
    return world


@pytest.mark.parametrize("speed", [0.5, 5.0, 40.0, 100.0])
@pytest.mark.parametrize(("shape", "turn", "height"), SHAPES)
def test_what_falls_stops_at_the_surface(shape: Shape, turn: Any, height: float, speed: float) -> None:
    with world_of(flat(), guard=False) as world:
        world.spawn("body", shape, 1.0, BodyState((0.01, 0.02, height + 0.7), turn, (0.0, 0.0, -speed)))
        lowest = math.inf
        for _ in range(240):
            world.step()
            lowest = min(lowest, world.state("body").position[2] - height)
        assert lowest > -1e-4
        assert world.state("body").position[2] == pytest.approx(height, abs=1e-4)


@pytest.mark.parametrize(("shape", "turn", "height"), SHAPES)
def test_what_slides_without_friction_keeps_its_speed_over_all_edges(shape: Shape, turn: Any, height: float) -> None:
    with world_of(flat(), friction=0.0) as world:
        world.spawn("body", shape, 1.0, BodyState((-3.0, 0.011, height), turn, (1.0, 0.3, 0.0)))
        world.step(960)
        state = world.state("body")
        assert state.linear == pytest.approx((1.0, 0.3, 0.0), abs=2e-3)
        assert math.hypot(*state.angular) < 1e-3


@pytest.mark.parametrize("speed", [0.01, 0.05])
@pytest.mark.parametrize("shape", [Sphere(0.2), Cylinder(0.1, 0.3), Capsule(0.1, 0.3)])
def test_slow_rollers_keep_their_speed(shape: Shape, speed: float) -> None:
    radius = 0.2 if isinstance(shape, Sphere) else 0.1
    with world_of(flat(), sleep=False) as world:
        state = BodyState((-1.0, 0.011, radius), LYING, (speed, 0.0, 0.0), (0.0, speed / radius, 0.0))
        world.spawn("body", shape, 1.0, state)
        world.step(2400)
        assert world.state("body").linear[0] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("degrees", [0.1, 0.2])
def test_a_ball_rolls_down_a_slight_slope_as_theory_says(degrees: float) -> None:
    slope = np.tile(math.tan(math.radians(degrees)) * 0.05 * np.arange(201), (201, 1))
    with world_of(HeightMap(slope, resolution=0.05, origin=(-5.0, -5.0)), sleep=False) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((2.0, 0.011, slope[0, 140] + 0.2)))
        world.step(60)
        before = world.state("ball").linear[0]
        world.step(960)
        expected = -5.0 / 7.0 * 9.81 * math.sin(math.radians(degrees)) * 4.0
        assert world.state("ball").linear[0] - before == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("edges", "spacing"), [((2.0, 1.0, 0.2), 0.02), ((1.0, 1.0, 0.2), 0.05)])
def test_wide_boxes_come_to_rest_on_rough_ground(edges: tuple[float, float, float], spacing: float) -> None:
    heights = np.random.default_rng(3).normal(scale=0.03, size=(201, 201))
    half = 100.0 * spacing
    with world_of(HeightMap(heights, resolution=spacing, origin=(-half, -half)), sleep=False) as world:
        world.spawn("box", Box(*edges), 10.0, BodyState((0.0, 0.0, 0.3)))
        world.step(480)
        state = world.state("box")
        assert math.hypot(*state.linear) < 1e-3 and math.hypot(*state.angular) < 1e-3


def test_balls_ride_on_waves() -> None:
    y, x = 0.1 * (np.mgrid[:101, :101] - 50.0)

    def waves(time: float) -> np.ndarray:
        return 0.2 * np.sin(x - 4.0 * time) * np.cos(0.7 * y)

    heightmap = HeightMap(waves(0.0), resolution=0.1, origin=(-5.0, -5.0))
    with world_of(heightmap) as world:
        for k in range(9):
            world.spawn(f"ball_{k}", Sphere(0.2), 1.0, BodyState((k % 3 - 1.0, k // 3 - 1.0, 0.45)))
        lowest = math.inf
        for step in range(480):
            if step % 4 == 0:
                heightmap.replace(waves(step * DT), time=step * DT)
            world.step()
            if step > 240:
                middles = np.array([world.state(name).position for name in world.bodies])
                ground = world.terrain.at(middles[:, :2], world.time).heights
                lowest = min(lowest, float((middles[:, 2] - ground).min()))
        assert lowest > 0.198  # above a slope the middle is higher than above level ground
        assert world.rescues == 0


def test_bodies_sleep_and_wake_when_their_ground_falls() -> None:
    heightmap = flat()
    with world_of(heightmap) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(480)
        assert world.is_asleep("box")
        heightmap.replace(np.full((201, 201), -0.5), time=world.time + 100.0)
        world.step(480)
        assert world.state("box").position[2] == pytest.approx(-0.4, abs=1e-3)


@pytest.fixture
def client() -> Any:
    bullet = BulletClient(pb.DIRECT)
    bullet.setGravity(0.0, 0.0, -9.81)
    yield bullet
    bullet.disconnect()


def ball(client: Any) -> int:
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=0.2)
    return int(client.createMultiBody(1.0, shape, basePosition=(0.0, 0.0, 0.5)))


def test_the_users_own_steps_are_enough(client: Any) -> None:
    body, ground = ball(client), Ground(client, flat(), from_map=True)
    ground.attach(body)
    ground.update(0.0, DT)
    for _ in range(480):
        client.stepSimulation()
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.2, abs=1e-4)


def test_a_ground_that_is_gone_leaves_the_world_usable(client: Any) -> None:
    body, ground = ball(client), Ground(client, flat(), from_map=True)
    ground.attach(body)
    ground.step(0.0, DT)
    del ground
    for _ in range(240):
        client.stepSimulation()
    client.removeBody(body)
    client.resetSimulation()
    client.stepSimulation()


def test_the_kind_of_contacts_may_change_under_a_body() -> None:
    with world_of(flat()) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.1)))
        for config in (
            WorldConfig(from_map=True),
            WorldConfig(),
            WorldConfig(from_map=True),
            WorldConfig(patch=PatchConfig(kind="heightfield")),
        ):
            world.configure(config)
            world.step(120)
            assert world.ground.exact == config.from_map
            assert world.state("box").position[2] == pytest.approx(0.1, abs=1e-3)


def table() -> TriangleMesh:
    """A floor, and a table of 1 m x 1 m whose top is 0.6 m above the floor and 20 mm thick."""
    return TriangleMesh(
        *mesh_parts.joined(mesh_parts.sheet(6.0, 1), mesh_parts.box((-0.5, -0.5, 0.58), (0.5, 0.5, 0.6)))
    )


@pytest.mark.parametrize(("shape", "turn", "height"), SHAPES)
def test_bodies_rest_on_a_table_and_under_it_as_the_ground_says(shape: Shape, turn: Any, height: float) -> None:
    with world_of(table()) as world:
        places = {"on": (0.1, 0.05, 0.6), "under": (0.05, 0.1, 0.0), "beside": (1.5, 0.0, 0.0)}
        for name, (x, y, z) in places.items():
            world.spawn(name, shape, 1.0, BodyState((x, y, z + height + 0.02), turn))
        world.step(960)
        for name, (_, _, z) in places.items():
            centre = world.state(name).position
            ground = float(world.ground.at([centre], world.time).z[0])
            assert ground == pytest.approx(z, abs=1e-9)
            assert centre[2] - height == pytest.approx(ground, abs=1e-3)
        assert world.rescues == 0


def test_a_moving_mesh_carries_a_box() -> None:
    vertices, triangles = mesh_parts.sheet(4.0, 8)
    mesh, rates = TriangleMesh(vertices, triangles), np.tile([0.05, 0.0, 0.1], (81, 1))
    with world_of(mesh) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.1, 0.1, 0.1)))
        for step in range(720):
            if step % 12 == 0:
                mesh.move(vertices + rates * step * DT, time=step * DT, velocities=rates)
            world.step()
        state = world.state("box")
        assert state.linear == pytest.approx((0.05, 0.0, 0.1), abs=2e-3)
        assert state.position == pytest.approx((0.25, 0.1, 0.4), abs=2e-3)


def test_what_sleeps_under_a_table_wakes_when_its_floor_falls() -> None:
    mesh = table()
    with world_of(mesh) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.1)))
        world.step(480)
        assert world.is_asleep("box")
        lowered = mesh.vertices - np.where(np.arange(mesh.size) < 4, 0.5, 0.0)[:, None] * [0.0, 0.0, 1.0]
        mesh.move(lowered, time=world.time + 100.0)
        world.step(480)
        assert world.state("box").position[2] == pytest.approx(-0.4, abs=1e-3)


def test_what_is_below_a_mesh_is_put_back() -> None:
    with world_of(table()) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((1.5, 0.0, -1.0)))
        world.step(240)
        assert world.rescues == 1
        assert world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)


def test_meshes_of_several_parts_are_ground_for_contacts_from_the_map_alone(client: Any) -> None:
    with pytest.raises(InputError, match="parts"):
        Ground(client, table())
    ground = Ground(client, table(), from_map=True)
    with pytest.raises(InputError, match="parts"):
        ground.configure(PatchConfig(kind="heightfield"))
    ground.attach(ball(client))
    ground.step(0.0, DT)
    assert ground.exact


def test_height_maps_and_meshes_are_ground_together() -> None:
    with world_of(flat()) as world:
        world.terrain.put("table", TriangleMesh(*mesh_parts.box((-0.5, -0.5, 0.58), (0.5, 0.5, 0.6))))
        for name, z in (("on", 0.75), ("under", 0.15)):
            world.spawn(name, Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, z)))
        world.step(480)
        assert world.state("on").position[2] == pytest.approx(0.7, abs=1e-4)
        assert world.state("under").position[2] == pytest.approx(0.1, abs=1e-4)
        assert world.rescues == 0


def test_a_robot_drives_over_a_mesh_as_over_the_same_height_map() -> None:
    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(0.03 * np.sin(3.0 * x) * np.cos(2.0 * y))

    x, y = np.meshgrid(*[np.linspace(-4.0, 4.0, 161)] * 2)
    heightmap = HeightMap(height(x, y), resolution=0.05, origin=(-4.0, -4.0))
    places = []
    for terrain in (heightmap, TriangleMesh(*mesh_parts.soup(mesh_parts.sheet(8.0, 160, height)))):
        bullet: Any = BulletClient(pb.DIRECT)
        bullet.setGravity(0.0, 0.0, -9.81)
        robot = bullet.loadURDF(f"{pybullet_data.getDataPath()}/husky/husky.urdf", [-1.0, 0.0, 0.25])
        ground = Ground(bullet, terrain, from_map=True)
        ground.attach(robot)
        for joint in range(bullet.getNumJoints(robot)):
            if b"wheel" in bullet.getJointInfo(robot, joint)[1]:
                bullet.setJointMotorControl2(robot, joint, pb.VELOCITY_CONTROL, targetVelocity=4.0, force=30.0)
        for step in range(720):
            ground.step(step * DT, DT)
        assert ground.exact
        places.append(bullet.getBasePositionAndOrientation(robot)[0])
        bullet.disconnect()
    assert places[0][0] > 0.5
    assert places[0] == pytest.approx(places[1], abs=2e-3)
