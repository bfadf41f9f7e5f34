"""Bodies on triangle meshes of any form rest on what the mesh is."""

from itertools import combinations, product
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, HeightMap, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import LYING, UPRIGHT, Turn, about_z
from tests.core import mesh_parts
from tests.core.contact_cases import random_case, random_ground
from tests.grounds import level, terrain_of
from tests.terrain.surfaces import distances, mesh_of, triangles_of

STEP = 1.0 / 240.0
BALL, BOX = Sphere(0.1), Box(0.2, 0.16, 0.12)
CYLINDER, CAPSULE = Cylinder(radius=0.1, height=0.16), Capsule(radius=0.06, height=0.2)
ABOUT_Z = about_z(0.3)
# Shapes and orientations, and the height of their middles at rest [m].
RESTS: list[tuple[Shape, Turn, float]] = [
    (BALL, UPRIGHT, 0.1), (BOX, UPRIGHT, 0.06), (CYLINDER, UPRIGHT, 0.08), (CAPSULE, UPRIGHT, 0.16),
    (BOX, ABOUT_Z, 0.06), (CYLINDER, LYING, 0.1), (CAPSULE, LYING, 0.06),
]  # fmt: skip
# Bullet's solver leaves 10 um of penetration.
RESTING = 1.2e-5
Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)


class GroundWorld(World):
    """Bodies of 1 kg that never sleep."""

    def __init__(self, ground: MainMesh | Terrain, step: float = STEP) -> None:
        super().__init__(ground, WorldConfig(physics=PhysicsConfig(rate=1.0 / step, sleep=False)))

    def add(
        self, shape: Shape, at: Vector, linear: Vector = STILL, angular: Vector = STILL, turn: Turn = UPRIGHT
    ) -> str:
        """Return the name of a body with its centre at a point [m] that moves [m/s] and turns [rad/s]."""
        name = f"body {len(self.bodies)}"
        self.spawn(name, shape, 1.0, BodyState(at, turn, linear, angular))
        return name

    def let_pass(self) -> None:
        """Let all bodies pass through one another."""
        for one, other in combinations(self.bodies.values(), 2):
            self.client.setCollisionFilterPair(one.uid, other.uid, -1, -1, 0)

    def position(self, body: str) -> np.ndarray:
        return np.array(self.state(body).position)


@pytest.mark.parametrize("speed", [0.5, 20.0, 100.0])
@pytest.mark.parametrize("form", ["map", "sheet", "soup", "blocks", "table"])
def test_what_falls_stops_at_the_surface(form: str, speed: float) -> None:
    sheet = mesh_parts.sheet(8.0, 31)
    table = mesh_parts.joined(mesh_parts.box((-4.0, -4.0, -0.05), (4.0, 4.0, 0.0)), mesh_parts.sheet(8.0, 1))
    table[0][8:, 2] = -1.0
    meshes = {"sheet": sheet, "soup": mesh_parts.soup(sheet), "blocks": mesh_parts.blocks(6, 0.0, 1.0), "table": table}
    with GroundWorld(level(201, 0.05) if form == "map" else TriangleMesh(*meshes[form])) as world:
        heights = {}
        for (shape, turn, height), x in product(RESTS, (0.1, 1.2, 2.1)):
            body = world.add(shape, (x, 0.3 * x, height + 0.5), (0.0, 0.0, -speed), turn=turn)
            heights[body] = height
        world.let_pass()
        for _ in range(240):
            world.step()
            assert min(world.position(body)[2] - height for body, height in heights.items()) > -1e-4
        np.testing.assert_allclose([world.position(body)[2] for body in heights], [*heights.values()], atol=RESTING)


@pytest.mark.parametrize("floor", ["map", "mesh"])
@pytest.mark.parametrize("thickness", [0.0, 0.002, 0.05])
def test_bodies_rest_on_a_table_and_under_it_as_the_ground_says(thickness: float, floor: str) -> None:
    """A table that is 0.6 m high; of no thickness it is one sheet."""
    top = mesh_parts.box((-0.5, -0.5, -thickness), (0.5, 0.5, 0.0)) if thickness else mesh_parts.sheet(1.0, 3)
    top[0][:, 2] += 0.6
    ground: Any = TriangleMesh(*mesh_parts.joined(mesh_parts.sheet(6.0, 1), top))
    if floor == "map":
        ground = terrain_of(floor=level(61), table=TriangleMesh(*top))
    with GroundWorld(ground) as world:
        known = []
        for (shape, turn, height), (x, y, z) in product(RESTS, [(0.1, 0.05, 0.6), (0.05, 0.1, 0.0), (1.5, 0.0, 0.0)]):
            world.add(shape, (x, y, z + height + 0.02), turn=turn)
            known.append((height, z))
        world.let_pass()
        world.step(960)
        centres, (heights, floors) = np.array([world.position(body) for body in world.bodies]), np.transpose(known)
        below = world.ground.at(centres, world.time).z
        np.testing.assert_allclose(below, floors, atol=1e-9)
        np.testing.assert_allclose(centres[:, 2] - heights, below, atol=RESTING)
        assert world.rescues == 0


def rough(kind: type, rng: np.random.Generator, scale: float, size: int) -> HeightMap | TriangleMesh:
    """White noise in cells of 0.1 m."""
    side = 10 * size + 1
    ground = HeightMap(rng.normal(scale=scale, size=(side, side)), resolution=0.1, origin=(-0.5 * size, -0.5 * size))
    return ground if kind is HeightMap else mesh_of(ground)


@pytest.mark.parametrize("kind", [HeightMap, TriangleMesh])
@pytest.mark.parametrize(
    ("radius", "speed", "overlap"),
    [(0.1, 2.0, 1e-3), (0.1, 10.0, 1e-3), (0.02, 2.0, 1e-3), (0.02, 10.0, 4e-3), (0.02, 40.0, 0.016)],
)
def test_balls_that_fall_onto_rough_ground_hardly_overlap_its_corners_and_edges_and_are_not_lost(
    kind: type, radius: float, speed: float, overlap: float
) -> None:
    rng = np.random.default_rng(5)
    ground = rough(kind, rng, 0.02, 4)
    facets = triangles_of(ground, 0.0)
    with GroundWorld(ground) as world:
        for x, y, vx, vy in rng.uniform((-1.0, -1.0, -0.5, -0.5), (1.0, 1.0, 0.5, 0.5), (8, 4)).tolist():
            world.add(Sphere(radius), (x, y, 0.5), (speed * vx, speed * vy, -speed))
        world.let_pass()
        for _ in range(60):
            world.step()
            for body in world.bodies:
                assert distances(facets, world.position(body)[None], 0.3)[0] > radius - overlap
        assert world.below_ground() == []


@pytest.mark.parametrize("kind", [HeightMap, TriangleMesh])
def test_balls_roll_over_rough_ground_as_in_small_steps(kind: type) -> None:
    ways = np.random.default_rng(2).uniform((-1.0, -1.0, -1.5, -1.5), (1.0, 1.0, 1.5, 1.5), (9, 4))
    found = []
    for step in (STEP, STEP / 40.0):
        with GroundWorld(rough(kind, np.random.default_rng(1), 0.01, 6), step=step) as world:
            for x, y, vx, vy in ways.tolist():
                world.add(BALL, (x, y, 0.16), (vx, vy, 0.0), (-vy / 0.1, vx / 0.1, 0.0))
            world.let_pass()
            world.step(round(0.5 / step))
            found.append([world.position(body) for body in world.bodies])
    assert np.median(np.linalg.norm(np.subtract(*found), axis=1)) < 0.02


@pytest.mark.parametrize("shape", [BALL, BOX, CYLINDER, CAPSULE], ids=["ball", "box", "cylinder", "capsule"])
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_stay_inside_a_closed_box(shape: Shape, turned: bool) -> None:
    room = mesh_parts.box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    with GroundWorld(TriangleMesh(*(mesh_parts.flipped(room) if turned else room))) as world:
        for direction in ((3.0, 0.4, 0.0), (-0.5, 4.0, 1.0), (2.0, 2.0, 6.0), (-8.0, 5.0, -3.0)):
            world.add(shape, (0.0, 0.0, 0.4), direction, (1.0, 2.0, 3.0))
        world.let_pass()
        for _ in range(30):
            world.step(24)
            for body in world.bodies:
                centre = world.position(body)
                assert np.abs(centre[:2]).max() < 0.5 and 0.0 < centre[2] < 1.0
                if shape is BALL:
                    assert min(0.5 - np.abs(centre[:2]).max(), centre[2], 1.0 - centre[2]) > 0.1 - 1e-3


def test_a_box_pushed_against_a_table_from_beside_is_not_lifted_onto_it() -> None:
    for top in (mesh_parts.sheet(1.0, 2), mesh_parts.box((-0.5, -0.5, -0.03), (0.5, 0.5, 0.0))):
        for height in (0.01, 0.04, 0.06, 0.09):
            top[0][:, 2] += height - top[0][:, 2].max()
            with GroundWorld(TriangleMesh(*mesh_parts.joined(mesh_parts.sheet(6.0, 1), top))) as world:
                body = world.add(BOX, (-1.0, 0.1, 0.06), (1.5, 0.0, 0.0))
                for _ in range(200):
                    world.step(2)
                    assert world.position(body)[2] < 0.08
                if height > 0.02:
                    assert world.position(body)[0] < -0.6 + 1e-3


@pytest.mark.parametrize("ground", ["mesh", "soup", "abutting"])
def test_inner_edges_of_a_flat_mesh_are_not_felt(ground: str) -> None:
    flat = mesh_parts.sheet(6.0, 60)
    if ground == "soup":
        flat = mesh_parts.soup(flat)
    if ground == "abutting":  # sheets and boxes whose corners lie on each other's edges
        flat = mesh_parts.joined(
            *[mesh_parts.box((x, y, -1.0), (x + 0.5, y + 0.7, 0.0)) for x in np.arange(-3, 3, 0.5)
              for y in np.arange(-3.0 + 0.35 * (2 * x % 2), 2.7, 0.7)]
        )  # fmt: skip
    with GroundWorld(TriangleMesh(*flat)) as world:
        ball = world.add(BALL, (-2.0, 0.9, 0.1), (1.0, 0.3, 0.0), (-3.0, 10.0, 0.0))
        places = ((BOX, 0.5, 0.06, ABOUT_Z), (CYLINDER, -0.5, 0.08, UPRIGHT), (BOX, -1.0, 0.06, UPRIGHT))
        sliders = [world.add(shape, (-2.0, y, z), (1.0, 0.1, 0.0), turn=turn) for shape, y, z, turn in places]
        for body in sliders:
            world.client.changeDynamics(world.bodies[body].uid, -1, lateralFriction=0.0)
        world.step(720)
        np.testing.assert_allclose(world.state(ball).linear, (1.0, 0.3, 0.0), atol=0.01)
        for body in sliders:
            np.testing.assert_allclose(world.state(body).linear, (1.0, 0.1, 0.0), atol=2e-3)
            np.testing.assert_allclose(world.state(body).angular, 0.0, atol=2e-3)


def test_parts_that_part_are_two_from_then_on() -> None:
    vertices, triangles = mesh_parts.joined(
        mesh_parts.box((-1.0, -1.0, -0.5), (0.0, 1.0, 0.0)), mesh_parts.box((0.0, -1.0, -0.5), (1.0, 1.0, 0.0))
    )
    mesh = TriangleMesh(vertices, triangles)
    lifted = vertices + np.where(np.arange(len(vertices)) >= 8, 0.3, 0.0)[:, None] * [0.0, 0.0, 1.0]
    with GroundWorld(mesh) as world:
        mesh.move(lifted, time=0.0)
        bodies = [world.add(BOX, (x, 0.0, 0.4)) for x in (-0.5, 0.5)]
        world.step(480)
        np.testing.assert_allclose([world.position(b)[2] for b in bodies], (0.06, 0.36), atol=RESTING)


def test_a_ball_is_held_back_before_what_it_meets_in_the_step() -> None:
    missed, met = [], 0
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        if seed % 20 == 0:
            ground = random_ground(rng)
        case = random_case("ball", ground, rng)
        radius = case.body.reach
        case = case.moved(np.array([0.0, 0.0, rng.uniform(0.02, 2.0) * radius]))
        way = rng.normal(size=3) * (1.0, 1.0, 0.3)
        way *= -np.sign(way[2]) * radius * rng.uniform(0.5, 3.0) / np.linalg.norm(way)
        shares = np.linspace(0.0, 1.0, 40)
        gaps = distances(ground.corners, case.position + shares[:, None] * way, radius) - radius
        first = next(iter(shares[gaps < -1e-3 * radius].tolist()), 0.0)
        if first == 0.0:
            continue
        met += 1
        for contacts in (case.contacts(way), case.contacts(way, with_mesh=True)):
            is_held = np.any(contacts[:, 6] + contacts[:, 3:6] @ way * first < 0.0)
            missed += [] if is_held else [seed]
    assert met > 100 and not missed
