"""Which bodies the followers of a ground belong to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.landing import Radii
from smartmesh_ros.terrain.grid import IntArray


class Roll(NamedTuple):
    """By the followers' indices: their ``names``, links as ``robot/link``; the simulated ``bodies`` they belong to,
    None = tracked; and the ``radii`` of those that may be slowed."""

    names: list[str]
    bodies: list[Body | None]
    radii: Radii

    def bodies_of(self, indices: IntArray) -> list[str]:
        """Names of the bodies that followers belong to, each once, in order."""
        return sorted({self.names[index].partition("/")[0] for index in indices.tolist()})


def call_roll(bodies: Iterable[Body], followers: list[Follower]) -> Roll:
    """The roll of ``followers`` of a world's ``bodies``."""
    owners = {body.uid: body for body in bodies}
    names, simulated = [], []
    for follower in followers:
        owner = owners[follower.body]
        link = owner.links.get(follower.link)
        names.append(owner.name if link is None else f"{owner.name}/{link}")
        simulated.append(None if owner.tracked else owner)
    return Roll(names, simulated, Radii.of(simulated))
