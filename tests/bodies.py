"""Bodies of every shape as tests know them, written independently of the package: where they are, turned how."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.patches.shapes import (
    BodyShape,
    ShapeTable,
    ball,
    box,
    capsule,
    compound,
    cylinder,
    hull,
)
from smartmesh_ros.patches.supports import no_supports
from smartmesh_ros.terrain.heightmap import HeightMap

FORMS = (
    "ball", "box", "cylinder", "capsule", "offset ball", "offset box", "offset cylinder", "tetrahedron", "compound"
)  # fmt: skip
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


def turn_about(vector: np.ndarray) -> np.ndarray:
    """The matrix of a rotation vector [rad], by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)


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


class Form:
    """A body's shape: as the package knows it, and which points are inside it."""

    def __init__(self, name: str, size: float, rng: np.random.Generator) -> None:
        self.round = "cylinder" in name
        self.capsule = name == "capsule"
        self.ball = "ball" in name
        self.tetrahedron = "tetrahedron" in name
        self.parts: list[Form] = []
        self.half = size * rng.uniform(0.4, 1.0, 3)
        if self.ball:
            self.half[:] = size
        elif self.round or self.capsule:
            self.half[1] = self.half[0]
        if self.capsule:  # along z, with its two half spheres
            self.half[2] = self.half[0] + rng.uniform(0.0, 1.0) * size
        offset = "offset" in name
        self.offset = rng.normal(scale=0.5 * size, size=3) if offset else np.zeros(3)
        self.turn = random_turn(rng) if offset and not self.ball else np.array([0.0, 0.0, 0.0, 1.0])
        self.corners = size * (rng.uniform(-0.2, 0.2, (4, 3)) + TETRAHEDRON)
        if name == "compound":
            self.parts = [Form("offset ball", 0.6 * size, rng), Form("offset box", 0.7 * size, rng)]
        self.shape = self._shape()
        self.radius = self.shape.radius

    def _shape(self) -> BodyShape:
        if self.parts:
            return compound([part.shape for part in self.parts])
        x, y, z = self.half.tolist()
        if self.ball:
            return ball(x, self.offset)
        if self.capsule:
            return capsule(x, 2.0 * (z - x), self.offset, self.turn)
        if self.round:
            return cylinder(x, 2.0 * z, self.offset, self.turn)
        if self.tetrahedron:
            return hull(self.corners)
        return box((2.0 * x, 2.0 * y, 2.0 * z), self.offset, self.turn)

    @property
    def middle(self) -> np.ndarray:
        """Middle of the shape in the body's frame (3,)."""
        return np.asarray(self.shape.record["offset"])

    def inside(self, points: np.ndarray, position: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Which points (..., 3) are inside the shape of a body at ``position``, whose axes are ``turn``'s columns."""
        if self.parts:
            return np.asarray(np.any([part.inside(points, position, turn) for part in self.parts], axis=0))
        axes = turn @ rotation(self.turn)
        middle = position @ axes + self.offset @ rotation(self.turn)
        own = (points.reshape(-1, 3) @ axes - middle).reshape(points.shape)
        if self.ball:
            return np.asarray((own**2).sum(axis=-1) <= self.half[0] ** 2)
        if self.capsule:
            straight = self.half[2] - self.half[0]
            own = own.copy()
            own[..., 2] -= np.clip(own[..., 2], -straight, straight)
            return np.asarray((own**2).sum(axis=-1) <= self.half[0] ** 2)
        if self.round:
            across = own[..., 0] ** 2 + own[..., 1] ** 2 <= self.half[0] ** 2
            return np.asarray(across & (np.abs(own[..., 2]) <= self.half[2]))
        if self.tetrahedron:
            first, edges = self.corners[0], (self.corners[1:] - self.corners[0]).T
            shares = (own - first) @ np.linalg.inv(edges).T
            return np.asarray((shares >= 0.0).all(axis=-1) & (shares.sum(axis=-1) <= 1.0))
        return np.asarray((np.abs(own) <= self.half).all(axis=-1))

    def surface(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Points (count, 3) of the shape in the body's frame, all over its surface."""
        if self.parts:
            return np.concatenate([part.surface(rng, count // 2) for part in self.parts])
        away = rng.normal(size=(count, 3))
        away /= np.linalg.norm(away, axis=1)[:, None]
        if self.ball:
            own = self.half[0] * away
        elif self.capsule:
            own = self.half[0] * away
            own[:, 2] += np.sign(away[:, 2]) * (self.half[2] - self.half[0])
        elif self.round:
            flat = np.hypot(away[:, 0], away[:, 1])[:, None]
            own = np.column_stack([self.half[0] * away[:, :2] / flat, rng.uniform(-1, 1, count) * self.half[2]])
        elif self.tetrahedron:
            shares = rng.dirichlet([0.5] * 4, count)
            shares[np.arange(count), rng.integers(4, size=count)] = 0.0  # on one of its faces
            own = shares / shares.sum(axis=1)[:, None] @ self.corners
        else:
            own = rng.uniform(-1.0, 1.0, (count, 3))
            own[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
            own *= self.half
        return np.asarray(own @ rotation(self.turn).T + self.offset)
