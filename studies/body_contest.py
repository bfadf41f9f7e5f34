"""The scenes of the accuracy study as contests: bodies of one shape on one map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.scene import Scene
from studies.configurations import Configuration
from studies.contest import Contest, Result, Rules, Runner, run
from studies.engines.engine import Engine, EngineBody, Setup
from studies.engines.registry import build
from studies.reference import reference_positions

# Number of pieces of a run, and processor time in one scene after which an engine is stopped [s].
PIECES, PATIENCE = 12, 2.5


class Poses(NamedTuple):
    """Centres (N, 3) [m] and orientations (N, 4) of the bodies."""

    positions: FloatArray
    orientations: FloatArray


class BodyContest(Contest):
    """A scene of the accuracy study."""

    def __init__(self, scene: Scene, pieces: int = PIECES) -> None:
        rules = Rules(
            name=scene.name, bodies=scene.bodies.count, duration=scene.duration, settle=scene.settle,
            samples=scene.samples, pieces=pieces, patience=PATIENCE, map_rate=scene.map_rate,
        )  # fmt: skip
        super().__init__(rules, scene.make_ground())
        self._scene, self._shape = scene, scene.bodies.make_shape()
        self._truth = scene.make_ground()

    def enter(self, configuration: Configuration) -> Engine:
        scene, shape = self._scene, self._shape
        bodies = [EngineBody(shape=shape, state=state, friction=scene.bodies.friction) for state in scene.starts()]  # type: ignore[arg-type]
        setup = Setup(
            heights=self.maps(0), resolution=scene.grid[1], bodies=bodies, dt=1.0 / configuration.rate,
            slide=scene.slide,
        )  # fmt: skip
        return build(configuration.engine, setup, configuration.options)

    def handing(self, configuration: Configuration, engine: Any, heights: Any) -> Callable[[], None]:
        if configuration.engine == "mujoco":
            stored = engine.normalised(heights)
            return lambda: engine.write(stored)
        own = configuration.engine in ("smartmesh", "checkout")
        ready = heights if own else np.array(heights, np.float64)
        return lambda: engine.set_ground(ready)

    def state(self, engine: Engine) -> Poses:
        return Poses(engine.positions(), engine.orientations())

    def measure(self, instant: float, runners: Sequence[Runner]) -> None:
        surface = self._scene.surface(self._truth.heights(instant), instant)
        for runner in runners:
            sample = runner.samples[instant]
            ground = surface.below(sample.state.positions)
            sample.below = sample.state.positions[:, 2] < ground
            if instant > self.rules.settle:
                sample.clearance = clearances(surface, self._shape, *sample.state)
                sample.clearance[np.isnan(ground)] = np.nan

    def centres(self, state: Poses) -> FloatArray:
        return state.positions

    def reference(self) -> FloatArray | None:
        return reference_positions(self._scene)


def run_scene(
    scene: Scene, chosen: Sequence[Configuration], say: Callable[[str], None], pieces: int = PIECES
) -> dict[str, Result]:
    """Run a scene in every configuration that suits it."""
    suited = [configuration for configuration in chosen if scene.slide != (0.0, 0.0) or not configuration.for_sliding]
    return run(BodyContest(scene, pieces), suited, say)
