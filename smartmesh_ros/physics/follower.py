"""What a patch is put under."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.physics.body_shapes import is_ball, is_round
from smartmesh_ros.terrain.grid import BoolArray


@dataclass(eq=False)
class Follower:
    """A body or link with a patch under it.

    ``shape``: a record of ``SHAPE``. ``solid``: it gets a collider; otherwise only the patch is computed. ``collider``:
    PyBullet's body of the collider it has now, if any. ``movable``: its body has a mass, so that physics moves it.
    ``rigid``: its body has no joints. ``ball``: it is a ball. ``round``: it is a cylinder or capsule that moves freely;
    wheels are not, because their joints hold them.
    """

    body: int
    link: int
    shape: Any
    solid: bool
    collider: int | None = None
    movable: bool = True
    rigid: bool = True

    def __post_init__(self) -> None:
        self.ball = is_ball(self.shape)
        self.round = self.link < 0 and is_round(self.shape)

    @property
    def radius(self) -> float:
        """Radius of the sphere around its centre of mass that holds it [m]."""
        return float(self.shape["radius"])

    def read_mobility(self, client: Any) -> None:
        """Reads from PyBullet whether the body is movable and rigid."""
        self.movable = client.getDynamicsInfo(self.body, -1)[0] > 0.0
        self.rigid = client.getNumJoints(self.body) == 0


class FollowerRoles(NamedTuple):
    """Followers (N,) that may be clamped before impact, ``free``, and that may be lifted out of the ground, ``own``."""

    free: BoolArray
    own: BoolArray


def roles_of(followers: list[Follower]) -> FollowerRoles:
    """Roles by what PyBullet tells of the bodies: ``free`` are movable rigid bodies, ``own`` are movable bodies."""
    own = np.array([follower.solid and follower.movable for follower in followers], bool)
    return FollowerRoles(own & np.array([follower.rigid for follower in followers], bool), own)
