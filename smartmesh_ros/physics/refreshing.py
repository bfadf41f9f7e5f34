"""When patches are brought up to date: with every map, and in between no more often than they are worth it.

Colliders move on with the ground's velocity by themselves, and a patch reaches as far as its body may go, so a patch of
a step ago does nearly as well as a new one; updating it costs as much as stepping the physics.
"""

from __future__ import annotations

import math

from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# A map that is expected so soon is waited for, longer by a part of that time and of the time patches may last: to bring
# them up to date just before it comes is to do it twice.
PATIENCE, SOON = 1.25, 1.5


class Refreshing:
    """Tells before each step whether patches are due."""

    def __init__(self) -> None:
        self._left = 0  # steps until they are, if nothing happens
        self._seen: list[tuple[MainMesh, int]] = []

    def hasten(self) -> None:
        """Has patches be due in the next step."""
        self._left = 0

    def due(self, terrain: Terrain) -> bool:
        """Whether they are: there is other ground, or their time has come."""
        self._left -= 1
        return self._left < 0 or self._seen != _versions(terrain)

    def begin(self, terrain: Terrain, time: float, dt: float, rate: float) -> int:
        """Notes that patches are brought up to date at ``time`` [s]; for how many steps of ``dt`` [s] that is to last
        where ``rate`` [Hz] is wanted (0 = one), or until the next map comes, if that is soon."""
        steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
        if steps > 1:
            lifetimes = [mesh.lifetime for mesh in terrain.tiles.values() if mesh.moving(time) and mesh.lifetime > 0.0]
            wait = max(round(PATIENCE * min(lifetimes) / dt), 1) if lifetimes else math.inf
            steps = int(wait) if wait <= SOON * steps else steps
        self._left, self._seen = steps - 1, _versions(terrain)
        return steps


def _versions(terrain: Terrain) -> list[tuple[MainMesh, int]]:
    return [(mesh, mesh.version) for mesh in terrain.tiles.values()]
