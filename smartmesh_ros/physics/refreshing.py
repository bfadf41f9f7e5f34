"""When patches are brought up to date: with the maps, and no more often than they are worth it.

Colliders move on with the ground's velocity by themselves, and a patch reaches as far as its body may go, so a patch of
a step ago does nearly as well as a new one; updating it costs as much as stepping the physics.
"""

from __future__ import annotations

import math

from smartmesh_ros.terrain.terrain import MainMesh, Terrain

# A map that is expected so soon is waited for, longer by a part of that time and of the time patches may last: to bring
# them up to date just before it comes is to do it twice.
PATIENCE, SOON = 1.25, 1.5
# Patches last for this share of their time even if maps come more often, but for the first maps of many: how fast the
# ground moves is known by the second of them.
LEAST, FIRST = 0.5, 4


class Refreshing:
    """Tells before each step whether patches are due."""

    def __init__(self) -> None:
        self._age = 0  # steps since they were brought up to date
        self._lasts, self._least = 0, 0  # steps that they last for, and that they last for if a map comes
        self._maps = 0  # how often in a row it was a map that they were brought up to date for
        self._seen: list[tuple[MainMesh, int]] = []

    def due(self, terrain: Terrain, *, hurried: bool = False) -> bool:
        """Whether they are: their time has come, or there is other ground. For a world that is ``hurried`` a map of the
        same ground is no reason."""
        self._age += 1
        if self._age >= self._lasts:
            return True
        now = _versions(terrain)
        if self._age >= self._least and not hurried:
            return now != self._seen
        return [mesh for mesh, _ in now] != [mesh for mesh, _ in self._seen]

    def begin(self, terrain: Terrain, time: float, dt: float, rate: float, *, hurried: bool = False) -> int:
        """Notes that patches are brought up to date at ``time`` [s]; for how many steps of ``dt`` [s] that is to last:
        as ``rate`` [Hz] says (0 = one), or until the next map comes, if that is soon; no less if ``hurried``."""
        seen, self._seen = self._seen, _versions(terrain)
        self._maps = self._maps + 1 if seen != self._seen else 0
        steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
        self._least = math.ceil(LEAST * steps) if self._maps >= FIRST else 1
        if steps > 1:
            lifetimes = [mesh.lifetime for mesh in terrain.tiles.values() if mesh.moving(time) and mesh.lifetime > 0.0]
            least = steps if hurried else self._least
            wait = max(round(PATIENCE * min(lifetimes) / dt), least) if lifetimes else math.inf
            steps = int(wait) if wait <= SOON * steps else steps
        self._age, self._lasts = 0, steps
        return steps


def _versions(terrain: Terrain) -> list[tuple[MainMesh, int]]:
    return [(mesh, mesh.version) for mesh in terrain.tiles.values()]
