"""What a patch is put under."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from smartmesh_ros.physics.body_shapes import is_ball


@dataclass(eq=False)
class Follower:
    """A body or link with a patch under it.

    ``shape``: a record of ``SHAPE``. ``solid``: it gets a collider; otherwise only the patch is computed. ``collider``:
    PyBullet's body of the collider it has now, if any.
    """

    body: int
    link: int
    shape: Any
    solid: bool
    collider: int | None = None

    def __post_init__(self) -> None:
        self.ball = is_ball(self.shape)

    @property
    def radius(self) -> float:
        """Radius of the sphere around its centre of mass that holds it [m]."""
        return float(self.shape["radius"])
