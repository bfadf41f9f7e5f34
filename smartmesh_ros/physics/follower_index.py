"""Which bodies the followers of a ground belong to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import BoolArray, IntArray


class FollowerIndex(NamedTuple):
    """By the followers' indices: their ``names``, links as ``robot/link``; the simulated ``bodies`` they belong to,
    None = tracked or a guest; which may be clamped before impact, ``free`` (N,): those that are no links; which this
    world simulates, ``own`` (N,), and which other worlds do, ``guest`` (N,). ``first``: the first follower of each
    PyBullet body; ``moving``: those PyBullet bodies that move by physics."""

    names: list[str]
    bodies: list[Body | None]
    free: BoolArray
    own: BoolArray
    guest: BoolArray
    first: dict[int, int]
    moving: frozenset[int]

    def bodies_of(self, indices: IntArray) -> list[str]:
        """Names of the bodies that followers belong to, each once, in order."""
        return sorted({self.names[index].partition("/")[0] for index in indices.tolist()})


def index_followers(bodies: Iterable[Body], followers: list[Follower]) -> FollowerIndex:
    """The index of ``followers`` of a world's ``bodies``."""
    owners = {body.uid: body for body in bodies}
    names, all_of = [], []
    for follower in followers:
        owner = owners[follower.body]
        link = owner.links.get(follower.link)
        names.append(owner.name if link is None else f"{owner.name}/{link}")
        all_of.append(owner)
    simulated = [body if body.simulated else None for body in all_of]
    free = np.array([not body.tracked and body.shape is not None for body in all_of], bool)
    own = np.array([body.simulated for body in all_of], bool)
    guest = np.array([bool(body.owner) for body in all_of], bool)
    first = {follower.body: index for index, follower in reversed(list(enumerate(followers)))}
    moving = frozenset(body.uid for body in all_of if not body.tracked)
    return FollowerIndex(names, simulated, free, own, guest, first, moving)
