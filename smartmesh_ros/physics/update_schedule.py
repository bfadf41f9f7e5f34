"""When patches are brought up to date: with the maps, and no more often than they are worth it.

Colliders move on with the ground's velocity by themselves, and a support holds for as far as its body may go, so one of
a step ago does nearly as well as a new one; updating it costs as much as stepping the physics.
"""

from __future__ import annotations

from smartmesh_ros.terrain.terrain import Terrain

# A map that is expected so soon is waited for, longer by a part of that time and of the time patches may last: to bring
# them up to date just before it comes is to do it twice.
MAP_WAIT, LONGEST_LIFE = 1.25, 1.5
# Patches last for this share of their time even if maps come more often, but for the first maps of many: how fast the
# ground moves is known by the second of them.
SHORTEST_LIFE, FIRST_MAPS = 0.5, 4


class UpdateSchedule:
    """Tells before each step whether patches are due."""

    def __init__(self) -> None:
        self._age = 0  # steps since they were brought up to date
        self._lifetime, self._lifetime_if_map = 0, 0  # steps that they last for, and that they last for if a map comes
        self._maps = 0  # how often in a row it was a map that they were brought up to date for
        self._revision, self._layout = -1, -1  # of the terrain then

    def due(self, terrain: Terrain, *, behind_real_time: bool = False) -> bool:
        """Whether they are: their time has come, or there is other ground. For a world that is ``behind_real_time`` real time a
        map of the same ground is no reason."""
        self._age += 1
        if self._age >= self._lifetime or terrain.layout_revision != self._layout:
            return True
        return self._age >= self._lifetime_if_map and not behind_real_time and terrain.changed_since(self._revision)

    def begin(self, terrain: Terrain, time: float, dt: float, rate: float, *, behind_real_time: bool = False) -> int:
        """Notes that patches are brought up to date at ``time`` [s]; for how many steps of ``dt`` [s] that is to last:
        as ``rate`` [Hz] says (0 = one), or until the next map comes, if that is soon; no less if ``behind_real_time``."""
        self._maps = self._maps + 1 if terrain.changed_since(self._revision) else 0
        self._revision, self._layout = terrain.revision, terrain.layout_revision
        steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
        self._lifetime_if_map = -int(-SHORTEST_LIFE * steps // 1) if self._maps >= FIRST_MAPS else 1
        if steps > 1:
            lifetimes = [mesh.lifetime for mesh in terrain.tiles.values() if mesh.lifetime > 0.0 and mesh.moving(time)]
            if lifetimes:
                wait = max(round(MAP_WAIT * min(lifetimes) / dt), steps if behind_real_time else self._lifetime_if_map)
                steps = wait if wait <= LONGEST_LIFE * steps else steps
        self._age, self._lifetime = 0, steps
        return steps
