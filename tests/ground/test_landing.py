"""Bodies meet the ground at its surface, however fast, and the guard catches what got below it."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.core import mesh_parts
from tests.grounds import level, moving
from tests.urdfs import joint, link, robot

DT = 1.0 / 240.0


def rough(seed: int = 0, scale: float = 0.02) -> HeightMap:
    rng = np.random.default_rng(seed)
    return HeightMap(rng.normal(scale=scale, size=(81, 81)), resolution=0.25, origin=(-10.0, -10.0))


def test_the_guard_puts_back_what_is_below_the_ground_and_counts_it() -> None:
    with World(rough(), WorldConfig()) as world:
        world.spawn("buried", Box(0.3, 0.3, 0.3), 1.0, BodyState((0.0, 0.0, -0.8), linear=(30.0, 0.0, 0.0)))
        world.spawn("fine", Sphere(0.2), 1.0, BodyState((3.0, 0.0, 0.5)))
        world.step()
        assert world.rescues == 1
        assert math.hypot(*world.state("buried").linear) <= 5.1
        world.step(240)
        assert world.rescues == 1
        assert world.below_ground() == []


@pytest.mark.parametrize("depth", [0.05, 0.15])
def test_what_starts_in_the_ground_leaves_it_slowly(depth: float) -> None:
    flat = level(41, 0.25)
    with World(flat) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.2 - depth)))
        speeds = []
        for _ in range(240):
            world.step()
            speeds.append(world.state("ball").linear[2])
        assert 0.1 < max(speeds) <= 1.01
        assert world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)


BARBELL = robot(
    link("near", moment=0.1), link("far", '<sphere radius="0.2"/>', moment=0.1),
    joint("rod", "fixed", "near", "far", xyz="1 0 0"),
)  # fmt: skip


@pytest.mark.parametrize("heights", [(0.0, 0.8), (0.8, 0.0)])
def test_the_guard_puts_back_a_robot_with_all_its_links(heights: tuple[float, float]) -> None:
    """Two links in ground of two heights: both are out of it at once, and the robot counts as one."""
    columns = np.repeat(heights, (25, 26))
    with World(HeightMap(np.tile(columns, (51, 1)), resolution=0.1, origin=(-2.5, -2.5))) as world:
        world.spawn_robot("barbell", BARBELL, BodyState((-0.5, 0.0, -0.05)))
        world.update()
        assert world.rescues == 1
        assert world.below_ground() == []
        lift = world.state("barbell").position[2] + 0.05
        assert lift == pytest.approx(0.85 + (0.1 if heights[0] else 0.2), abs=0.02)


def test_the_guard_leaves_tracked_bodies_where_they_are_said_to_be(world: World) -> None:
    world.track("arm", 0.2, BodyState((0.0, 0.0, -0.5)))
    world.step(5)
    assert world.rescues == 0
    assert world.state("arm").position == pytest.approx((0.0, 0.0, -0.5))


@pytest.mark.parametrize("general", [False, True], ids=["map", "general mesh"])
def test_bodies_ride_on_ground_that_accelerates(general: bool) -> None:
    """Maps at 20 Hz lag; the ground's acceleration, seen where the body stands, makes up for most of it."""
    rise, rate = 0.3, 4.0
    flat = level(41, 0.25)
    vertices, triangles = mesh_parts.sheet(10.0, 40)
    mesh = TriangleMesh(vertices, triangles)
    with World(mesh if general else flat) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.2 - rise)))
        gaps = []
        for step in range(720):
            if step % 12 == 0:
                height = -rise * math.cos(rate * world.time)
                if general:
                    mesh.move(vertices + (0.0, 0.0, height), time=world.time)
                else:
                    flat.replace(np.full((41, 41), height), time=world.time)
            world.step()
            if step > 120:
                gaps.append(world.state("ball").position[2] - 0.2 + rise * math.cos(rate * world.time))
        # Little more than half the lag of a constant velocity, which is a T^2.
        assert np.percentile(np.abs(gaps), 95) < 0.6 * rise * rate**2 * 0.05**2


def test_bodies_land_although_the_clock_is_set_back_while_they_fall() -> None:
    def ground(time: float) -> np.ndarray:
        return np.full((41, 41), 0.4 * time)

    heightmap = HeightMap(ground(0.0), resolution=0.25, origin=(-5.0, -5.0))
    with World(heightmap) as world:
        rise = 0.0
        for step in range(240):
            if step == 60:
                rise = world.time
                world.reset_time()
            if step % 8 == 0:
                heightmap.replace(ground(world.time + rise), time=world.time)
            if step == 48:
                world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.01, 0.02, 1.1)))
            world.step()
        assert world.rescues == 0
        clearance = world.state("ball").position[2] - 0.2 - float(world.terrain.at([[0.0, 0.0]], world.time).heights[0])
        assert abs(clearance) < 0.005


@pytest.mark.parametrize("rate", [60.0, 120.0, 240.0])
def test_what_rides_on_waves_moves_as_fast_as_they_do(rate: float) -> None:
    """In a step of 1/60 s what lies on the ground would fall 3 mm: slowed each time, it would gain speed for ever."""
    x, _ = np.meshgrid(np.arange(64) * 0.1, np.arange(64) * 0.1)

    def waves(time: float) -> np.ndarray:
        return 0.05 * np.sin(x - 4.0 * time)

    with World(HeightMap(waves(0.0), resolution=0.1), WorldConfig(physics=PhysicsConfig(rate=rate))) as world:
        for index in range(36):
            position = (0.4 + 0.9 * (index % 6), 0.4 + 0.9 * (index // 6), 0.22)
            world.spawn(f"ball {index}", Sphere(0.15), 1.0, BodyState(position))
        fastest = 0.0
        for _ in moving(world, waves, round(3.0 * rate), every=round(rate / 60.0)):
            if world.time > 1.0:
                fastest = max(fastest, *(abs(world.state(name).linear[2]) for name in world.bodies))
        assert world.rescues == 0
        assert fastest < 0.05 * 4.0 + 9.81 / rate + 0.15


def test_the_guard_leaves_who_crosses_a_ridge_and_finds_at_once_who_is_below_it() -> None:
    ridge = HeightMap(
        -2.0 * np.abs(np.arange(-10.0, 11.0))[:, None] * np.ones(21), resolution=2.0, origin=(-20.0, -20.0)
    )
    with World(ridge) as world:
        world.spawn("ball", Sphere(0.5), 1.0, BodyState((0.0, -0.5, 0.6)))
        uid = world.bodies["ball"].uid
        for y in np.linspace(-0.5, 0.8, 200):  # over the ridge, and below the plane that was up to then under it
            world.client.resetBasePositionAndOrientation(uid, (0.0, y, 0.55 - abs(y)), (0, 0, 0, 1))
            world.update()
        assert world.rescues == 0
        world.client.resetBasePositionAndOrientation(uid, (0.0, 0.8, -0.9), (0, 0, 0, 1))
        world.update()
        assert world.rescues == 1


def test_the_guard_finds_who_went_a_little_way_into_a_cliff() -> None:
    y = 0.5 * np.arange(-20, 21)
    cliff = HeightMap(20.0 * np.maximum(y, 0.0)[:, None] * np.ones(41), resolution=0.5, origin=(-10.0, -10.0))
    with World(cliff) as world:
        world.spawn("ball", Sphere(0.5), 1.0, BodyState((0.0, -0.01, 0.2)))
        world.update()
        assert world.rescues == 0
        uid = world.bodies["ball"].uid
        world.client.resetBasePositionAndOrientation(uid, (0.0, 0.03, 0.2), (0, 0, 0, 1))
        world.time += 0.06
        world.update()
        assert world.rescues == 1


SIDE = 41


def clearances_where_ground_starts(
    shape: Shape, start: BodyState, speed: float, heights: np.ndarray, *, sleep: bool = True
) -> list[float]:
    """How high a body that has come to rest is above where it would ride [m], in each step of a second in which the
    ground rises at ``speed`` from one step to the next."""
    still = np.zeros((SIDE, SIDE))
    heightmap = HeightMap(heights, resolution=0.1, origin=(-2.0, -2.0), velocities=still)
    with World(heightmap, WorldConfig(physics=PhysicsConfig(sleep=sleep))) as world:
        world.spawn("body", shape, 1.0, start)
        world.step(240)
        rest, found = world.state("body").position[2], []
        for step in range(240):
            if step % 4 == 0:
                rise = speed * step * DT
                heightmap.replace(heights + rise, time=1.0 + step * DT, velocities=still + speed)
            world.step()
            found.append(world.state("body").position[2] - rest - speed * (step + 1) * DT)
        return found


@pytest.mark.parametrize(
    ("speed", "scale", "lowest"),
    [(1.0, 0.0, -1e-4), (2.0, 0.0, -1e-4), (5.0, 0.0, -1e-4), (2.0, 0.02, -0.01), (5.0, 0.02, -0.01)],
)
def test_a_body_at_rest_rides_on_ground_that_starts_to_rise_at_once(speed: float, scale: float, lowest: float) -> None:
    """And is not thrown, also on rough ground."""
    heights = np.random.default_rng(3).normal(scale=scale, size=(SIDE, SIDE))
    start = BodyState((0.0, 0.0, float(heights.max()) + 0.15))
    found = clearances_where_ground_starts(Box(0.3, 0.3, 0.3), start, speed, heights)
    assert max(found) <= 1e-3
    assert min(found) >= lowest


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_cylinder_rides_on_a_plane_that_starts_to_rise_at_once(slope: float) -> None:
    angle = math.atan(slope)
    turn = (0.0, -math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))
    start = BodyState((-0.0501 * math.sin(angle), 0.0, 0.0501 * math.cos(angle)), turn)
    plane = np.tile(slope * (0.1 * np.arange(SIDE) - 2.0), (SIDE, 1))
    # Its contacts take some steps to form anew after sleep.
    found = clearances_where_ground_starts(Cylinder(radius=0.15, height=0.1), start, 1.5, plane, sleep=False)
    assert np.abs(found).max() < 1e-3


@pytest.mark.parametrize("speed", [1.0, 2.0, 20.0])
def test_a_body_at_rest_that_is_sent_into_flat_ground_stays_on_it(world: World, speed: float) -> None:
    world.spawn("box", Box(0.3, 0.3, 0.3), 1.0, BodyState((0.0, 0.0, 0.15)))
    world.step(240)
    place = world.state("box")
    world.move("box", BodyState(place.position, place.orientation, linear=(0.0, 0.0, -speed)))
    heights = []
    for _ in range(240):
        world.step()
        heights.append(world.state("box").position[2] - 0.15)
    assert max(heights) <= 1e-3
    assert min(heights) >= -1e-3


def test_a_body_in_contact_stops_where_it_runs_into_a_wall() -> None:
    """A ball that rolls at 20 m/s meets a wall: the floor that it touches is no reason to let it in."""
    heights = np.zeros((SIDE, SIDE))
    heights[:, 30:] = 1.0
    depths = []
    with World(HeightMap(heights, resolution=0.1, origin=(-2.0, -2.0))) as world:
        world.spawn("ball", Sphere(0.15), 1.0, BodyState((-0.5, 0.01, 0.15)))
        world.step(60)
        x, y, z = world.state("ball").position
        world.move("ball", BodyState((x, y, z), linear=(20.0, 0.0, 0.0), angular=(0.0, 20.0 / 0.15, 0.0)))
        slope = np.array([-1.0, 0.1]) / math.hypot(1.0, 0.1)  # of the wall, which rises by 1 m in a cell
        for _ in range(40):
            world.step()
            x, _, z = world.state("ball").position
            depths.append(0.15 - float(slope @ (x - 0.9, z)))
    assert max(depths) <= 2e-3


@pytest.mark.parametrize("shape", [Sphere(0.25), Box(0.4, 0.3, 0.5)], ids=["sphere", "box"])
def test_a_body_that_falls_obeys_ballistics_until_it_rests(world: World, shape: Sphere | Box) -> None:
    world.spawn("body", shape, 2.0, BodyState((0.0, 0.0, 1.25)))
    world.step(72)
    fallen = 0.3
    # Symplectic Euler falls g dt t / 2 further than the parabola.
    expected = 1.25 - 0.5 * 9.81 * fallen**2 - 0.5 * 9.81 * fallen / 240.0
    assert world.state("body").position[2] == pytest.approx(expected, abs=1e-6)
    world.step(240)
    assert world.state("body").position[2] == pytest.approx(0.25, abs=1e-3)
    force = sum(contact.normal_force for contact in world.contacts())
    assert force == pytest.approx(2.0 * 9.81, rel=0.01)
