"""An evaluation scene as a case."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.tools.evaluation.scene import Scene
from smartmesh_ros.tools.tune.case import Case, Event, Ground, MapCame, Span, Start, Truth
from smartmesh_ros.tools.tune.replay import FINE_RATE
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

    def bodies(self) -> Sequence[Start]:
        return [partial(self._spawn, f"body_{index}", state) for index, state in enumerate(self._states)]

    def events(self) -> Iterator[Event]:
        return self._maps(self._scene.map_rate)

    def finest_events(self) -> Iterator[Event] | None:
        if self._scene.reference == "none":
            return None
        return self._maps(FINE_RATE if self._scene.moves else 0.0)

    def truth(self) -> Truth:
        scene, ground = self._scene, self._scene.make_ground()

        def at(time: float) -> list[Ground]:
            heights: Any = ground.heights(time if scene.moves else 0.0)
            return [Ground(scene.surface(np.array(heights), time))]

        return at

    def _maps(self, rate: float) -> Iterator[Event]:
        """Yield a map at every 1 / ``rate`` [s], 0 = a single one."""
        scene, ground = self._scene, self._scene.make_ground()
        for time in (number / rate for number in itertools.count()) if rate else (0.0,):
            geometry = replace(scene.geometry, origin=(scene.slide[0] * time, scene.slide[1] * time, 0.0))
            heights: Any = ground.heights(time)
            yield MapCame(arrives=time, at=time, tile="", raster=Raster(geometry, heights))

    def _spawn(self, name: str, state: BodyState, world: World) -> bool:
        world.spawn(name, self._scene.bodies.make_shape(), 1.0, state)
        return True
