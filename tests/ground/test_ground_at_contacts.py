"""Contacts move as the ground does at each of them: bodies ride on ground that waves, rocks and turns."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, GridGeometry, HeightMap, Sphere, Terrain, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import LYING, UPRIGHT, about_y, rotation, surface_of
from tests.core import mesh_parts
from tests.grounds import add, terrain_of, world_of
from tests.urdfs import link, robot

RATE, SIDE, CELL, HALF = 240.0, 65, 0.25, 8.0
BALL, BOX, WHEEL, FOOT = Sphere(0.2), Box(0.5, 0.4, 0.3), Cylinder(height=0.2, radius=0.25), Sphere(0.1)  # of a robot
AXIS = np.linspace(-HALF, HALF, SIDE)
X, Y = np.meshgrid(AXIS, AXIS)


def waves(x: FloatArray, y: FloatArray, time: float) -> FloatArray:
    """Rings that come in with up to 9 m/s^2 [m]."""
    return np.asarray(0.35 * np.sin(1.8 * np.hypot(x, y) + 5.0 * time))


def hills(x: FloatArray, y: FloatArray, _: float = 0.0) -> FloatArray:
    return np.asarray(0.3 * np.sin(1.5 * x) * np.sin(1.5 * y))


Change = Callable[[float], None]  # brings the ground to a time [s]


def one_map() -> tuple[Terrain, Change]:
    ground = HeightMap(waves(X, Y, 0.0), resolution=CELL, origin=(-HALF, -HALF))
    return terrain_of(all=ground), lambda time: ground.replace(waves(X, Y, time), time=time)


def two_tiles() -> tuple[Terrain, Change]:
    """With a gap of a cell between them, under the middle of the bodies."""
    west, east = X[:, : SIDE // 2], X[:, SIDE // 2 :]
    y = Y[:, :1]
    tiles = {
        name: HeightMap(waves(part, y, 0.0), resolution=CELL, origin=(part[0, 0], -HALF))
        for name, part in (("west", west), ("east", east))
    }

    def change(time: float) -> None:
        tiles["west"].replace(waves(west, y, time), time=time)
        tiles["east"].replace(waves(east, y, time), time=time)

    return terrain_of(**tiles), change


def turning_map() -> tuple[Terrain, Change]:
    """Hills that turn about z at 0.4 rad/s."""
    terrain = Terrain()

    def change(time: float) -> None:
        cos, sin = math.cos(0.4 * time), math.sin(0.4 * time)
        origin = (HALF * (sin - cos), -HALF * (sin + cos), 0.0)
        geometry = GridGeometry(rows=SIDE, columns=SIDE, resolution=CELL, origin=origin, yaw=0.4 * time)
        terrain.put("", HeightMap(hills(X, Y), geometry=geometry, time=time))

    change(0.0)
    return terrain, change


def rocking_mesh() -> tuple[Terrain, Change]:
    """Hills that rock about y by up to 0.3 rad, with up to 1.2 rad/s."""
    vertices, triangles = mesh_parts.sheet(2.0 * HALF, SIDE - 1, hills)
    mesh = TriangleMesh(vertices, triangles)

    def change(time: float) -> None:
        mesh.move(vertices @ rotation(about_y(0.3 * math.sin(4.0 * time))).T, time=time)

    return terrain_of(all=mesh), change


def as_robot(radius: float) -> str:
    return robot(link("ball", f'<sphere radius="{radius}"/>'))


def depth_of(world: World, name: str, shape: Shape) -> float:
    """How deep a body is in the ground [m]."""
    state = world.state(name)
    points = surface_of(shape) @ rotation(np.array(state.orientation)).T + state.position
    ground = world.ground.at(points[:, :2], world.time)
    return float(np.max((ground.z - points[:, 2]) * ground.normals[:, 2]))


# Depth that a share of the bodies does not exceed [m], [%]. Of a wheel that turns, another point of the rim may be the
# lowest at the end of a step.
MOST = {BALL: (0.3e-3, 99), BOX: (1.2e-3, 99), WHEEL: (0.4e-3, 90), FOOT: (0.3e-3, 99)}


@pytest.mark.parametrize("ground", [one_map, two_tiles, turning_map, rocking_mesh])
def test_bodies_on_moving_ground_do_not_sink_in(ground: Callable[[], tuple[Terrain, Change]]) -> None:
    """Told in each step, so that only contacts can be wrong."""
    terrain, change = ground()
    rng = np.random.default_rng(3)
    depths: dict[Shape, list[float]] = {shape: [] for shape in MOST}
    with world_of(terrain, sleep=False) as world:
        bodies: dict[str, Shape] = {}
        for k, (x, y) in enumerate(rng.uniform(-4.0, 4.0, (16, 2)) * (0.3, 1.0)):
            shape = list(MOST)[k % 4]
            start = BodyState((x, y, 1.0), LYING if shape is WHEEL else UPRIGHT)
            bodies[f"{k}"] = shape
            add(world, f"{k}", as_robot(shape.radius) if shape is FOOT else shape, start)
        for step in range(round(2.0 * RATE)):
            if step:
                change(world.time)
            world.step()
            if step > RATE and step % 5 == 0:
                for name, shape in bodies.items():
                    depths[shape].append(depth_of(world, name, shape))
    for shape, (most, share) in MOST.items():
        assert np.percentile(depths[shape], share) < most, shape


@pytest.mark.parametrize("made", [Sphere, as_robot], ids=["body", "robot"])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_ball_leaves_a_flank_that_rises_by_its_restitution(made: Any, restitution: float) -> None:
    """Relative to the ground at the contact, which moves as no ground under its middle does; told with the true gap."""
    rises = np.clip(X / CELL, 0.0, 1.0)  # [m/s]
    ground = HeightMap(rises * 0.15, resolution=CELL, origin=(-HALF, -HALF))
    with world_of(ground, restitution=restitution) as world:
        for step in range(1, 31):  # the velocities are known
            ground.replace(rises * (0.15 + step / RATE), time=step / RATE)
            world.step()
        add(world, "ball", made(0.3), BodyState((-0.03, 0.01, 0.65), linear=(0.0, 0.0, -1.0)))
        pressed = []
        while not pressed:
            step += 1
            ground.replace(rises * (0.15 + step / RATE), time=step / RATE)
            before, time = world.state("ball"), world.time
            world.step()
            pressed = [contact for contact in world.contacts() if contact.normal_force > 0.0]
        after, normal = world.state("ball"), np.array(pressed[0].normal)
        place = np.array(pressed[0].position)
        speed = np.clip(place[0] / CELL, 0.0, 1.0)
        assert 0.1 < speed < 0.9 and place[2] == pytest.approx(speed * (0.15 + time), abs=1e-6)
        assert -pressed[0].depth == pytest.approx(np.linalg.norm(before.position - place) - 0.3, abs=1e-6)
        closing, leaving = ((np.array(state.linear) - (0.0, 0.0, speed)) @ normal for state in (before, after))
        allowed = pressed[0].depth * RATE if restitution == 0.0 else 0.0  # it comes as far as the ground
        assert leaving == pytest.approx(-restitution * closing + allowed, rel=0.03, abs=0.02)


def of_two_balls(*heights: float) -> str:
    """A robot of one link with balls at these heights, in this order [m]."""
    ball = '<geometry><sphere radius="0.2"/></geometry>'
    balls = "".join(f'<collision><origin xyz="0 0 {z}"/>{ball}</collision>' for z in heights)
    return robot(link("base", "", more=balls))


@pytest.mark.parametrize(
    "body",
    [Sphere(0.2), as_robot(0.2), of_two_balls(0.0, 0.5), of_two_balls(0.5, 0.0)],
    ids=["body", "robot", "low part first", "low part last"],
)
def test_friction_against_spinning_is_that_with_the_ground(body: Any) -> None:
    terrain, change = turning_map()
    with world_of(terrain, sleep=False) as world:
        add(world, "ball", body, BodyState((0.0, 0.0, 0.2)))
        world.client.changeDynamics(world.bodies["ball"].uid, -1, spinningFriction=0.05)
        for _ in range(120):
            change(world.time)
            world.step()
        assert world.state("ball").angular[2] == pytest.approx(0.4, abs=0.01)
