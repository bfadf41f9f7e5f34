"""Bodies of every shape as tests know them, written independently of the package: where they are, turned how."""

import math
from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Ground, HeightMap, Terrain
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Solid, Sphere
from smartmesh_ros.terrain.terrain import MainMesh

Turn = tuple[float, float, float, float]
UPRIGHT: Turn = (0.0, 0.0, 0.0, 1.0)
LYING: Turn = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # with its z along y
TETRAHEDRON = np.array([[1.0, 0.0, -0.4], [-0.5, 0.8, -0.4], [-0.5, -0.8, -0.4], [0.0, 0.0, 1.0]])
TETRAHEDRON.flags.writeable = False  # tests of one process share it


def about_y(angle: float) -> Turn:
    """The quaternion of a turn [rad]."""
    return 0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)


def about_z(angle: float) -> Turn:
    """The quaternion of a turn [rad]."""
    return 0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)


def yaw_of(q: Turn) -> float:
    """The angle by which a unit quaternion turns about z [rad]."""
    x, y, z, w = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def rate_of_turn(levers: np.ndarray, speeds: np.ndarray, loads: np.ndarray) -> float:
    """Rate [rad/s] at which Coulomb friction on contacts (n, 2) [m] balances: its power is least there. They carry
    ``loads`` [N], and their surfaces run forwards, along x, at ``speeds`` [m/s]."""
    ones, zeros = np.ones(len(loads)), np.zeros(len(loads))
    motions = np.stack([np.stack([ones, zeros, -levers[:, 1]], 1), np.stack([zeros, ones, levers[:, 0]], 1)], 1)
    run = np.column_stack([speeds, zeros])
    found = np.zeros(3)  # vx, vy and the rate
    for _ in range(100):  # least squares, weighted by load over slip
        weights = loads / np.linalg.norm(motions @ found - run, axis=1)
        matrix = np.einsum("k,kij,kil->jl", weights, motions, motions)
        found = np.linalg.solve(matrix, np.einsum("k,kij,ki->j", weights, motions, run))
    return float(found[2])


def rotation(q: np.ndarray | Turn) -> np.ndarray:
    """The matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def random_turn(rng: np.random.Generator) -> np.ndarray:
    """A unit quaternion."""
    q = rng.normal(size=4)
    return np.asarray(q / np.linalg.norm(q))


@cache
def surface_of(shape: Shape) -> np.ndarray:
    """Points (n, 3) all over a shape, in its frame."""
    if isinstance(shape, Box):
        grid = np.array(np.meshgrid(*[np.linspace(-0.5, 0.5, 7)] * 3)).reshape(3, -1).T
        return np.asarray(grid[np.abs(grid).max(axis=1) == 0.5] * (shape.x, shape.y, shape.z))
    if isinstance(shape, Cylinder):
        turns = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        ring = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1) * shape.radius
        sides = [ring + (0.0, 0.0, z) for z in shape.height * np.linspace(-0.5, 0.5, 5)]
        ends = [end * (share, share, 1.0) for share in (0.0, 0.3, 0.6, 0.8) for end in (sides[0], sides[-1])]
        return np.concatenate([*sides, *ends])
    assert isinstance(shape, Sphere | Capsule)
    k = np.arange(2000)
    z, turns = 1.0 - 2.0 * (k + 0.5) / len(k), np.pi * (1.0 + np.sqrt(5.0)) * k
    ball = np.stack([np.sqrt(1.0 - z * z) * np.cos(turns), np.sqrt(1.0 - z * z) * np.sin(turns), z], axis=1)
    away = shape.height if isinstance(shape, Capsule) else 0.0
    return np.asarray(shape.radius * ball + 0.5 * away * np.sign(z)[:, None] * [0.0, 0.0, 1.0])


def reach(shape: Shape, n: np.ndarray) -> float:
    """How far a shape reaches from its middle along a unit vector in its frame [m]."""
    if isinstance(shape, Box):
        return float(0.5 * np.abs(n) @ (shape.x, shape.y, shape.z))
    if isinstance(shape, Cylinder):
        return shape.radius * math.hypot(n[0], n[1]) + 0.5 * shape.height * abs(n[2])
    return shape.radius + (0.5 * shape.height * abs(n[2]) if isinstance(shape, Capsule) else 0.0)


@cache
def below_high_ground() -> tuple[Any, Ground, int]:
    """A client with a body and ground of 1024 m, for tests that ask how far it is lifted out of it."""
    client: Any = BulletClient(pb.DIRECT)
    high = HeightMap(np.full((3, 3), 1024.0), resolution=100.0, origin=(-100.0, -100.0))
    return client, Ground(client, high), put(client, Sphere(0.1), (0.0, 0.0, 0.0))


def lowest_of(shape: BodyShape, position: np.ndarray, turn: np.ndarray) -> float:
    """Height of the lowest point of a body that is below 1024 m [m]: how far it must be lifted to get out of ground of
    that height."""
    client, ground, body = below_high_ground()
    client.resetBasePositionAndOrientation(body, position, turn)
    ground.attach(body, shape=shape)
    ground.update(0.0, 1.0 / 240.0)
    ground.detach(body)
    return 1024.0 - height(client, body) + float(position[2])


def put(client: Any, shape: Solid, at: Iterable[float], mass: float = 1.0, **options: Any) -> int:
    """A body in a PyBullet client of the test's own; returns its id."""
    return int(client.createMultiBody(mass, client.createCollisionShape(**shape.bullet()), basePosition=at, **options))


def ground_of(client: Any, terrain: MainMesh | Terrain, *bodies: int) -> Ground:
    """The ground of a client, to which these bodies are attached."""
    ground = Ground(client, terrain)
    for body in bodies:
        ground.attach(body)
    return ground


def height(client: Any, body: int) -> float:
    """Height of the middle of a body [m]."""
    return float(client.getBasePositionAndOrientation(body)[0][2])


def run(ground: Ground, steps: int = 240) -> None:
    """Step the world of a ground so many times, from the clock of the ground on."""
    for _ in range(steps):
        ground.step(ground.clock, 1.0 / 240.0)
