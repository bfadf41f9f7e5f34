"""Maps attached bodies and links to the world's bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import BoolArray, IntArray


class FollowerIndex(NamedTuple):
    """Data of the attached bodies, by their index.

    ``names``: links are ``robot/link``. ``bodies``: the simulated body, None = tracked, or simulated by another node.
    ``free`` (N,): may be clamped before impact, because it is no link. ``own`` (N,): simulated by this world. ``guest``
    (N,): simulated by another node. ``first``: index of the first entry of each PyBullet body. ``moving``: PyBullet
    bodies that move by physics.
    """

    names: list[str]
    bodies: list[Body | None]
    free: BoolArray
    own: BoolArray
    guest: BoolArray
    first: dict[int, int]
    moving: frozenset[int]

    def bodies_of(self, indices: IntArray) -> list[str]:
        """Return the names of the bodies at ``indices``, sorted and without duplicates."""
        return sorted({self.names[index].partition("/")[0] for index in indices.tolist()})


def index_followers(bodies: Iterable[Body], followers: list[Follower]) -> FollowerIndex:
    """Build the index of the ``followers`` of a world's ``bodies``."""
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
