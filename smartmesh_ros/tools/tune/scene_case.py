"""An evaluation scene as a case."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.tools.evaluation.reference import FINE_RATE, HORIZON, reference_positions
from smartmesh_ros.tools.evaluation.scene import Scene
from smartmesh_ros.tools.tune.case import SLACK, Case, Ground, Span
from smartmesh_ros.tools.tune.events import Event, MapCame, Start
from smartmesh_ros.tools.tune.reference import finest_positions
from smartmesh_ros.world.world import World

# Length of a confirming run, in searching runs.
LONGER = 2.0


class SceneCase(Case):
    """A scene with its own rate of maps and initial states of bodies."""

    def __init__(self, scene: Scene, start: Mapping[str, Any]) -> None:
        self.name, self.title = scene.name, scene.title
        self.start = {**start, "physics.friction": scene.bodies.friction}
        self.identity = hashlib.sha256(f"{scene!r} {sorted(self.start.items())!r}".encode()).hexdigest()[:12]
        self.span = Span(search=scene.duration, confirm=LONGER * scene.duration, settle=scene.settle)
        self._scene = scene
        self._states = scene.starts()
        self.fresh()

    def fresh(self) -> None:
        self._ground, self._true = self._scene.make_ground(), self._scene.make_ground()
        self._maps: dict[int, Any] = {}

    def bodies(self) -> Sequence[Start]:
        return [partial(self._spawn, f"body_{index}", state) for index, state in enumerate(self._states)]

    def events(self, after: float, until: float) -> Sequence[Event]:
        rate = self._scene.map_rate
        if not rate:
            return [self._map(0, 0.0)] if after < 0.0 <= until else []
        first = math.floor((after + SLACK) * rate) + 1 if after >= 0.0 else 0
        last = math.floor((until + SLACK) * rate)
        return [self._map(number, number / rate) for number in range(first, last + 1)]

    def truth(self, time: float) -> Sequence[Ground]:
        heights: Any = self._true.heights(time if self._scene.moves else 0.0)
        return [Ground(self._scene.surface(np.array(heights), time), 0.0)]

    def forget(self, before: float) -> None:
        for number in [number for number in self._maps if number < before * self._scene.map_rate - 1.0]:
            del self._maps[number]

    def reference(self) -> dict[str, Vector] | None:
        scene, horizon = self._scene, self.span.horizon
        if scene.reference == "none" or (scene.reference == "whole" and horizon < HORIZON):
            return None
        if scene.reference == "finest":
            finest = SceneCase(replace(scene, map_rate=FINE_RATE if scene.moves else 0.0), self.start)
            return finest_positions(finest, self.start, horizon)
        found = reference_positions(scene)
        return None if found is None else {f"body_{index}": (x, y, z) for index, (x, y, z) in enumerate(found.tolist())}

    def _map(self, number: int, time: float) -> MapCame:
        if number not in self._maps:
            self._maps[number] = self._ground.heights(time)
        scene = self._scene
        geometry = replace(scene.geometry, origin=(scene.slide[0] * time, scene.slide[1] * time, 0.0))
        return MapCame(arrives=time, at=time, tile="", raster=Raster(geometry, self._maps[number]))

    def _spawn(self, name: str, state: BodyState, world: World) -> bool:
        world.spawn(name, self._scene.bodies.make_shape(), 1.0, state)
        return True
