"""Bodies of every shape as tests know them, written independently of the package: where they are, turned how."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.shapes import SHAPE, ShapeKind

FORMS = ("ball", "box", "cylinder", "capsule", "offset ball", "offset box", "offset cylinder")


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


class Form:
    """A body's shape: its record, and which points are inside it."""

    def __init__(self, name: str, size: float, rng: np.random.Generator) -> None:
        self.round = "cylinder" in name
        self.capsule = name == "capsule"
        self.ball = "ball" in name
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
        reach = float(np.linalg.norm(self.half))
        if self.ball or self.capsule:
            reach = float(self.half[2])
        elif self.round:
            reach = float(np.hypot(self.half[0], self.half[2]))
        self.radius = reach + float(np.linalg.norm(self.offset))
        kind = ShapeKind.BALL if self.ball else ShapeKind.ROUND if self.round or self.capsule else ShapeKind.BOX
        self.record: Any = np.array((kind, *self.half, self.offset, self.turn, self.radius), SHAPE)

    def inside(self, points: np.ndarray, position: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Which points (..., 3) are inside the shape of a body at ``position``, whose axes are ``turn``'s columns."""
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
        return np.asarray((np.abs(own) <= self.half).all(axis=-1))

    def surface(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Points (count, 3) of the shape in the body's frame, on its surface."""
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
        else:
            own = rng.uniform(-1.0, 1.0, (count, 3))
            own[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
            own *= self.half
        return np.asarray(own @ rotation(self.turn).T + self.offset)
