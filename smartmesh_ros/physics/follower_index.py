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
    None = tracked; and which may be clamped before impact, ``free`` (N,): those that are no links."""

    names: list[str]
    bodies: list[Body | None]
    free: BoolArray

    def bodies_of(self, indices: IntArray) -> list[str]:
        """Names of the bodies that followers belong to, each once, in order."""
        return sorted({self.names[index].partition("/")[0] for index in indices.tolist()})


def index_followers(bodies: Iterable[Body], followers: list[Follower]) -> FollowerIndex:
    """The index of ``followers`` of a world's ``bodies``."""
    owners = {body.uid: body for body in bodies}
    names, simulated = [], []
    for follower in followers:
        owner = owners[follower.body]
        link = owner.links.get(follower.link)
        names.append(owner.name if link is None else f"{owner.name}/{link}")
        simulated.append(None if owner.tracked else owner)
    free = np.array([body is not None and body.shape is not None for body in simulated], bool)
    return FollowerIndex(names, simulated, free)
