"""Contacts worked out from the map itself (``patch.kind`` *auto*)."""

import math
from pathlib import Path
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
    InputError,
    PatchConfig,
    PhysicsConfig,
    Sphere,
    World,
    WorldConfig,
)
from smartmesh_ros.ground import map_contacts
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.urdfs import HUSKY, joint, link, robot

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
    world = World(ground, WorldConfig(physics=PhysicsConfig(**physics)))
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


@pytest.mark.parametrize("speed", [0.01, 0.05])
@pytest.mark.parametrize("shape", [Sphere(0.2), Cylinder(0.1, 0.3), Capsule(0.1, 0.3)])
def test_slow_rollers_keep_their_speed(shape: Shape, speed: float) -> None:
    radius = 0.2 if isinstance(shape, Sphere) else 0.1
    with world_of(flat(), sleep=False) as world:
        state = BodyState((-1.0, 0.011, radius), LYING, (speed, 0.0, 0.0), (0.0, speed / radius, 0.0))
        world.spawn("body", shape, 1.0, state)
        world.step(2400)
        assert world.state("body").linear[0] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(("edges", "spacing"), [((2.0, 1.0, 0.2), 0.02), ((1.0, 1.0, 0.2), 0.05)])
def test_wide_boxes_come_to_rest_on_rough_ground(edges: tuple[float, float, float], spacing: float) -> None:
    heights = np.random.default_rng(3).normal(scale=0.03, size=(201, 201))
    half = 100.0 * spacing
    with world_of(HeightMap(heights, resolution=spacing, origin=(-half, -half)), sleep=False) as world:
        world.spawn("box", Box(*edges), 10.0, BodyState((0.0, 0.0, 0.3)))
        world.step(480)
        state = world.state("box")
        assert math.hypot(*state.linear) < 1e-3 and math.hypot(*state.angular) < 1e-3


def ball(client: Any) -> int:
    shape = client.createCollisionShape(pb.GEOM_SPHERE, radius=0.2)
    return int(client.createMultiBody(1.0, shape, basePosition=(0.0, 0.0, 0.5)))


def test_ground_that_rises_carries_a_body_in_the_users_own_steps(client: Any) -> None:
    heightmap = HeightMap(np.zeros((41, 41)), resolution=0.1, origin=(-2.0, -2.0))
    body = client.createMultiBody(
        1.0, client.createCollisionShape(pb.GEOM_SPHERE, radius=0.2), basePosition=(0, 0, 0.2)
    )
    ground = Ground(client, heightmap)
    ground.attach(body)
    for step in range(240):
        if step % 4 == 0:
            heightmap.replace(np.full((41, 41), 0.5 * step * DT), time=step * DT)
        client.stepSimulation()
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.2 + 0.5, abs=1e-3)


def test_a_ground_that_is_gone_leaves_the_world_usable(client: Any) -> None:
    body, ground = ball(client), Ground(client, flat())
    ground.attach(body)
    ground.step(0.0, DT)
    del ground
    for _ in range(240):
        client.stepSimulation()
    client.removeBody(body)
    client.resetSimulation()
    client.stepSimulation()


@pytest.mark.parametrize("rate", [240.0, 960.0, 2000.0])
def test_ground_that_heaves_throws_nothing_however_short_the_step(rate: float) -> None:
    """By 0.1 m once a second, known by 20 maps a second: what a map corrects is no reason to throw a body."""
    heightmap = flat()
    with world_of(heightmap, rate=rate, sleep=False) as world:
        world.spawn("box", Box(0.3, 0.3, 0.3), 1.0, BodyState((0.01, 0.02, 0.15)))
        highest = 0.0
        for step in range(round(3.0 * rate)):
            height = 0.1 * math.sin(2.0 * math.pi * world.time)
            if step % round(rate / 20.0) == 0:
                heightmap.replace(np.full(heightmap.heights.shape, height), time=world.time)
            world.step()
            if world.time > 1.5:
                true = 0.1 * math.sin(2.0 * math.pi * world.time)
                highest = max(highest, world.state("box").position[2] - 0.15 - true)
    assert highest < 0.01


@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.5, 0.8, 0.9])
def test_what_bounces_rises_as_high_as_its_restitution_says(restitution: float) -> None:
    for shape, height in ((Sphere(0.2), 0.2), (Box(0.3, 0.3, 0.2), 0.1), (Cylinder(0.15, 0.2), 0.1)):
        with world_of(flat(), restitution=restitution) as world:
            world.spawn("body", shape, 1.0, BodyState((0.01, 0.02, height + 1.0)))
            rising: list[float] = []
            while world.time < 0.6 + restitution:
                world.step()
                if rising or world.state("body").linear[2] > 0.0:
                    rising.append(world.state("body").position[2] - height)
            assert max(rising, default=0.0) == pytest.approx(restitution**2, rel=0.03, abs=1e-3)


def test_a_client_has_one_ground_at_a_time(client: Any) -> None:
    first = Ground(client, flat())
    first.attach(ball(client))
    with pytest.raises(InputError, match="has a ground already"):
        Ground(client, flat())
    first.close()
    body, second = ball(client), Ground(client, flat())
    second.attach(body)
    for step in range(480):
        second.step(step * DT, DT)
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.2, abs=1e-4)


def test_a_client_that_was_reset_is_named_and_takes_a_new_ground(client: Any) -> None:
    ground = Ground(client, flat())
    ground.attach(ball(client))
    client.stepSimulation()
    client.resetSimulation()
    with pytest.raises(InputError, match="the PyBullet client was reset"):
        ground.step(DT, DT)
    client.stepSimulation()
    ground.close()
    client.setGravity(0.0, 0.0, -9.81)
    body, again = ball(client), Ground(client, flat())
    again.attach(body)
    for _ in range(480):
        client.stepSimulation()
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.2, abs=1e-4)


def test_a_core_that_reads_bullets_memory_otherwise_is_not_used(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_contacts, "PROBE", ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (0.0,) * 3, (1e-3, 0.0, 0.0)))
    assert Ground(client, flat()).no_proxies == ""
    monkeypatch.setattr(np, "allclose", lambda *_, **__: False)
    body, ground = ball(client), Ground(client, flat())
    assert ground.no_proxies == "the core was built for another PyBullet"
    monkeypatch.undo()
    ground.attach(body)
    for step in range(480):
        ground.step(step * DT, DT)
    assert not ground.exact
    assert client.getBasePositionAndOrientation(body)[0][2] == pytest.approx(0.2, abs=1e-3)


WHEELED = f"{pybullet_data.getDataPath()}/racecar/racecar.urdf"


def test_contacts_of_a_robot_at_rest_are_those_that_a_step_may_close(client: Any) -> None:
    """Others would cost the solver time in each step, and do nothing."""
    heights = np.random.default_rng(5).normal(scale=0.01, size=(101, 101))
    ground = Ground(client, HeightMap(heights, resolution=0.04, origin=(-2.0, -2.0)))
    robot = client.loadURDF(WHEELED, (0.0, 0.0, 0.1))
    ground.attach(robot)
    for step in range(480):
        ground.step(step * DT, DT)
    distances = [contact[8] for contact in client.getContactPoints(robot)]
    assert len(distances) >= 3
    assert max(distances) < 2e-3


FEET = (0.6, -0.6)


def lander(plate: float) -> str:
    """A body on four sliding legs, with foot plates of this thickness [m]."""
    limit = '<limit lower="-0.1" upper="0.5" effort="10000" velocity="100"/>'
    legs = [
        link(f"foot_{x}_{y}", f'<box size="0.2 0.2 {plate}"/>', 5.0, 0.03)
        + joint(f"leg_{x}_{y}", "prismatic", "body", f"foot_{x}_{y}", limit, f"{x} {y} -0.9", "0 0 1")
        for x in FEET
        for y in FEET
    ]
    return robot(link("body", "", 200.0, 50.0), *legs)


def stroke(urdf: Path, height: float, speed: float, *, from_map: bool) -> float:
    """Return how far springs and dampers let the legs of a lander in [m]; its body falls from ``height`` [m]."""
    client = BulletClient(pb.DIRECT)
    try:
        client.setGravity(0.0, 0.0, -9.81)
        robot = client.loadURDF(str(urdf), (0.0, 0.0, height))
        client.resetBaseVelocity(robot, (0.0, 0.0, -speed))
        legs, longest = range(len(FEET) ** 2), 0.0
        client.setJointMotorControlArray(robot, legs, pb.VELOCITY_CONTROL, forces=[0.0] * len(legs))
        if from_map:
            ground = Ground(client, flat())
            ground.attach(robot)
        else:
            client.createMultiBody(0.0, client.createCollisionShape(pb.GEOM_PLANE))
        for step in range(120):
            for leg in legs:
                place, rate = client.getJointState(robot, leg)[:2]
                longest = max(longest, place)
                force = -8000.0 * place - 700.0 * rate
                client.setJointMotorControl2(robot, leg, pb.TORQUE_CONTROL, force=force)
            if from_map:
                ground.step(step * DT, DT)
            else:
                client.stepSimulation()
        return longest
    finally:
        client.disconnect()


@pytest.mark.parametrize("speed", [2.0, 3.0])
@pytest.mark.parametrize("plate", [0.01, 0.02])
def test_a_lander_takes_the_same_stroke_at_each_phase_of_the_step(plate: float, speed: float, tmp_path: Path) -> None:
    (tmp_path / "lander.urdf").write_text(lander(plate))
    strokes = {
        from_map: [
            stroke(
                tmp_path / "lander.urdf", 0.9 + 0.5 * plate + speed * DT * (4.0 + phase / 6), speed, from_map=from_map
            )
            for phase in range(6)
        ]
        for from_map in (True, False)
    }
    assert strokes[True] == pytest.approx(strokes[False], rel=0.05)
    assert max(strokes[True]) < 1.01 * min(strokes[True])


def test_what_hovers_far_above_is_lifted_by_ground_that_rises() -> None:
    speed = 5.0
    heightmap = flat(cells=81)
    with world_of(heightmap, gravity=(0.0, 0.0, 0.0), guard=False) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 1.5)))
        for step in range(120):
            if step % 4 == 0:
                heightmap.replace(np.full((81, 81), speed * world.time), time=world.time)
            world.step()
            assert world.state("box").position[2] - 0.1 > speed * world.time - 1e-3
        assert world.state("box").position[2] > 1.6


@pytest.mark.parametrize("spin", [2.0, 10.0, 20.0])
def test_a_rod_whose_tip_comes_down_from_the_side_stops_at_the_surface(spin: float) -> None:
    with world_of(flat(), gravity=(0.0, 0.0, 0.0), guard=False) as world:
        world.spawn("rod", Box(2.0, 0.1, 0.1), 1.0, BodyState((0.0, 0.0, 0.8), angular=(0.0, spin, 0.0)))
        lowest = math.inf
        for _ in range(120):
            world.step()
            lowest = min(lowest, world.client.getAABB(world.bodies["rod"].uid)[0][2])
        assert lowest > -1e-3


def table(thickness: float = 0.02) -> TriangleMesh:
    """A floor, and a table of 1 m x 1 m whose top is 0.6 m above the floor; of thickness 0 one sheet."""
    top = mesh_parts.box((-0.5, -0.5, 0.6 - thickness), (0.5, 0.5, 0.6))
    if thickness == 0.0:
        top = mesh_parts.sheet(1.0, 3)
        top[0][:, 2] = 0.6
    return TriangleMesh(*mesh_parts.joined(mesh_parts.sheet(6.0, 1), top))


@pytest.mark.parametrize("thickness", [0.0, 0.002, 0.05])
@pytest.mark.parametrize(("shape", "turn", "height"), SHAPES)
def test_bodies_rest_on_a_table_and_under_it_as_the_ground_says(
    shape: Shape, turn: Any, height: float, thickness: float
) -> None:
    with world_of(table(thickness)) as world:
        places = {"on": (0.1, 0.05, 0.6), "under": (0.05, 0.1, 0.0), "beside": (1.5, 0.0, 0.0)}
        for name, (x, y, z) in places.items():
            world.spawn(name, shape, 1.0, BodyState((x, y, z + height + 0.02), turn))
        world.step(960)
        for name, (_, _, z) in places.items():
            centre = world.state(name).position
            ground = float(world.ground.at([centre], world.time).z[0])
            assert ground == pytest.approx(z, abs=1e-9)
            assert centre[2] - height == pytest.approx(ground, abs=2e-5)
        assert world.rescues == 0


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
    ground = Ground(client, table())
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
        husky = bullet.loadURDF(HUSKY, [-1.0, 0.0, 0.25])
        ground = Ground(bullet, terrain)
        ground.attach(husky)
        for wheel in range(bullet.getNumJoints(husky)):
            if b"wheel" in bullet.getJointInfo(husky, wheel)[1]:
                bullet.setJointMotorControl2(husky, wheel, pb.VELOCITY_CONTROL, targetVelocity=4.0, force=30.0)
        for step in range(720):
            ground.step(step * DT, DT)
        assert ground.exact
        places.append(bullet.getBasePositionAndOrientation(husky)[0])
        bullet.disconnect()
    assert places[0][0] > 0.5
    assert places[0] == pytest.approx(places[1], abs=2e-3)
