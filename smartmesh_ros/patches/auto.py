"""As much ground as each body needs, looked at again only when it may need another."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.choice import FIXED
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.grid_search import GridSearch
from smartmesh_ros.patches.lively import OFTEN
from smartmesh_ros.patches.looked import Looked
from smartmesh_ros.patches.looks import Looks
from smartmesh_ros.patches.moving import Moving
from smartmesh_ros.patches.standing import Standing
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.heightmap import HeightMap


class AutoPatches:
    """Chooses for each body and keeps the choice while it holds.

    A choice is made for a ball: the body's bounding sphere, larger by how near it may come to the ground until the next
    look (some steps of its motion relative to the ground), and for how far it may slide. It is made again when the body
    moved further than that, after some steps on moving ground, and when a new map came, unless maps come so steadily
    that the ground is known ahead for that long.
    """

    def __init__(self, config: PatchConfig, search: GridSearch, stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._standing, self._looked = Standing(), Looked()
        self._looks = Looks(config, self._standing, self._looked, search, stopwatch)
        self._time = -np.inf
        # What ground at rest gave, by tile.
        self._at_rest: dict[str, tuple[IntArray, list[PatchBatch], IntArray]] = {}

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings; bodies are looked at anew."""
        self._looks.config = config
        self.forget(slice(None))

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        self._standing.set_bodies(kept)
        self._looked.set_bodies(kept)
        self._at_rest.clear()

    def forget(self, bodies: IntArray | slice) -> None:
        """Has bodies looked at anew."""
        self._standing.forget(bodies)
        self._looked.forget(bodies)

    def patches(
        self, name: str, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch],
        *, lively: bool,
    ) -> tuple[list[PatchBatch], IntArray]:  # fmt: skip
        """Patches on the tile ``name`` at ``time`` [s] for steps of ``dt`` [s], and which of ``moving`` need one of
        fixed extent instead (m,): at the tile's edge, and where looking would be in vain, as on ``lively`` ground."""
        bodies, standing, method = moving.bodies, self._standing, self._looks.config.collect
        if time < self._time:  # the clock was set anew: what holds until some time holds no more
            self.forget(slice(None))
            self._at_rest.clear()
        self._time = time
        if ((standing.state[bodies] == FIXED) & (standing.until[bodies] > time)).all():
            return [], np.arange(len(bodies))
        moves = heightmap.moving(time)
        rest = None if moves else self._at_rest.get(name)
        if moves:
            standing.follow(heightmap, bodies, time, method)
            self._at_rest.pop(name, None)
        elif rest is None:
            standing.forget(bodies)
        due = self._looked.due(standing, heightmap, moving, time, dt)
        if due.any():
            lively = moves and (lively or heightmap.lifetime <= OFTEN * dt)
            self._looks.look(heightmap, moving.of(due), time, dt, before, lively=lively)
        elif rest is not None and np.array_equal(rest[0], bodies):
            return list(rest[1]), rest[2]
        with self._stopwatch.stage("collect"):
            batches, fixed = standing.batches(name, heightmap, bodies, moving.positions_w, time, method)
        if not moves:
            self._at_rest[name] = (bodies, list(batches), fixed)
        return batches, fixed
