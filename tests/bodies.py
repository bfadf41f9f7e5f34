"""Bodies of every shape as tests know them, written independently of the package: where they are, turned how."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from smartmesh_ros import HeightMap
from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.patches.shapes import BodyShape, ShapeTable
from smartmesh_ros.report.supports import no_supports

TETRAHEDRON = np.array([[1.0, 0.0, -0.4], [-0.5, 0.8, -0.4], [-0.5, -0.8, -0.4], [0.0, 0.0, 1.0]])


def rotation(q: np.ndarray) -> np.ndarray:
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


def shapes_of(shapes: Iterable[BodyShape]) -> ShapeTable:
    """Shapes in the first slots of a table."""
    table, made = ShapeTable(), list(shapes)
    table.reserve(len(made))
    for slot, shape in enumerate(made):
        table.put(slot, shape)
    return table


def state_at(position: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """The table (1, 13) of a body at rest."""
    return np.concatenate([position, turn, np.zeros(6)])[None]


def foot_on(corners: np.ndarray, shape: BodyShape, position: np.ndarray, turn: np.ndarray) -> Any:
    """The support of a body on a mesh of triangles (T, 3, 3), or of one (3, 3), with its foot, normal and gap."""
    points, supports = np.ascontiguousarray(corners, np.float64).reshape(-1, 3), no_supports(1)
    triangles = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
    CORE.find_mesh_foot(points, triangles, shapes_of([shape]).core, state_at(position, turn), 0, as_bytes(supports))
    return supports[0]


def lowest_of(shape: BodyShape, position: np.ndarray, turn: np.ndarray) -> float:
    """Height of the lowest point of a body that is below 1024 m [m]: how far it must be lifted to get out of ground of
    that height."""
    high = HeightMap(np.full((3, 3), 1024.0), resolution=100.0, origin=(-100.0, -100.0))
    [(_, lift, _)] = CORE.find_below(
        shapes_of([shape]).core, state_at(position, turn), np.zeros(1, np.int64), [high.core_reader], 0.0
    )
    return 1024.0 - float(lift)


def put(client: Any, shape: Shape, at: tuple[float, float, float], mass: float = 1.0, **options: Any) -> int:
    """A body in a PyBullet client of the test's own; returns its id."""
    return int(client.createMultiBody(mass, client.createCollisionShape(**shape.bullet()), basePosition=at, **options))


def height(client: Any, body: int) -> float:
    """Height of the middle of a body [m]."""
    return float(client.getBasePositionAndOrientation(body)[0][2])
