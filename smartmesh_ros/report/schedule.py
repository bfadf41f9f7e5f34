"""When the report's colliders are updated: with new maps, and at a rate. Only they need a schedule; contacts from the
map are those of each step."""

from __future__ import annotations

from smartmesh_ros.terrain.terrain import Terrain

# Wait up to MAP_WAIT map intervals for the next map, if the refresh then comes within LONGEST_LIFE refresh intervals.
# Refreshing just before a map arrives would do the work twice.
MAP_WAIT, LONGEST_LIFE = 1.25, 1.5
# Shortest lifetime of patches if maps arrive faster [refresh intervals]. Ignored for the first FIRST_MAPS maps, because
# two maps are needed to estimate the ground's velocity.
SHORTEST_LIFE, FIRST_MAPS = 0.5, 4


class UpdateSchedule:
    """Decides before each step whether patches must be refreshed: with new maps, and no more often than a refresh is
    worth.

    Between refreshes PyBullet moves the colliders with the ground's velocity, and a support covers the predicted motion
    of its body. A support that is one step old is therefore nearly as good as a new one, but a refresh costs as much as
    a physics step.
    """

    def __init__(self) -> None:
        self._age = 0  # steps since the last refresh
        self._lifetime, self._lifetime_if_map = 0, 0  # steps until the next refresh; the same if a map arrives
        self._maps = 0  # successive refreshes that a map triggered
        self._revision, self._layout = -1, -1  # of the terrain at the last refresh

    def due(self, terrain: Terrain) -> bool:
        """Return True if the patches must be refreshed: they expired, or the terrain changed."""
        self._age += 1
        if self._age >= self._lifetime or terrain.layout_revision != self._layout:
            return True
        return self._age >= self._lifetime_if_map and terrain.changed_since(self._revision)

    def begin(self, terrain: Terrain, time: float, dt: float, rate: float) -> int:
        """Note a refresh at ``time`` [s] and return its lifetime in steps of ``dt`` [s]: the interval of ``rate`` [Hz]
        (0 = one step), or the time until the next map if that is about as long."""
        self._maps = self._maps + 1 if terrain.changed_since(self._revision) else 0
        self._revision, self._layout = terrain.revision, terrain.layout_revision
        steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
        self._lifetime_if_map = -int(-SHORTEST_LIFE * steps // 1) if self._maps >= FIRST_MAPS else 1
        if steps > 1:
            lifetimes = [mesh.lifetime for mesh in terrain.tiles.values() if mesh.lifetime > 0.0 and mesh.moving(time)]
            if lifetimes:
                wait = max(round(MAP_WAIT * min(lifetimes) / dt), self._lifetime_if_map)
                steps = wait if wait <= LONGEST_LIFE * steps else steps
        self._age, self._lifetime = 0, steps
        return steps
