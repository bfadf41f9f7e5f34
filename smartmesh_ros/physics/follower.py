"""Attached bodies and links, which have a patch each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.physics.body_shapes import is_ball, is_round
from smartmesh_ros.terrain.grid import BoolArray


@dataclass(eq=False)
class Follower:
    """An attached body or link, with a patch under it.

    ``shape``: a record of ``SHAPE``. ``solid``: has a collider; otherwise only the patch is computed. ``collider``:
    PyBullet body of its current collider, None = no collider. ``movable``: the body has a mass, so that physics moves
    it. ``rigid``: the body has no joints. ``ball``: the shape is a ball. ``round``: the shape is a cylinder or capsule
    that moves freely; wheels are excluded, because their joints hold them.
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
        """Bounding radius about the centre of mass [m]."""
        return float(self.shape["radius"])

    def read_mobility(self, client: Any) -> None:
        """Read from PyBullet whether the body is movable and rigid."""
        self.movable = client.getDynamicsInfo(self.body, -1)[0] > 0.0
        self.rigid = client.getNumJoints(self.body) == 0


class FollowerRoles(NamedTuple):
    """Followers (N,) that may be clamped before impact, ``free``, and that may be lifted out of the ground, ``own``."""

    free: BoolArray
    own: BoolArray


def roles_of(followers: list[Follower]) -> FollowerRoles:
    """Return the roles of bodies from PyBullet's data: ``free`` are movable rigid bodies, ``own`` are movable
    bodies."""
    own = np.array([follower.solid and follower.movable for follower in followers], bool)
    return FollowerRoles(own & np.array([follower.rigid for follower in followers], bool), own)
