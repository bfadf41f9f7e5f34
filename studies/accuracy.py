"""The study of speed against accuracy, and of stability: ``make studies`` runs it whole."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from smartmesh_ros import BodyState, MotionConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.scene import Scene, read_scenes
from studies.chart import README_SCENE, draw_readme
from studies.configurations import Configuration, configurations
from studies.contest import FINE_RATE, HORIZON, Contest, Result, Runner, run
from studies.engines.engine import Engine, EngineBody, Setup, build
from studies.matrix.arena import METHODS
from studies.matrix.run import draw_box, draw_matrix, matrix_table, run_matrix
from studies.pages import save
from studies.tables import Charts, write_blocks

CHARTS = Charts(
    "accuracy", "make studies", "accuracy.md", "accuracy", "body", tables="accuracy_tables.md", part="out/studies"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the scenes and the stability matrix; writes JSON, pictures and tables."""
    options = parser().parse_args(arguments)
    out = CHARTS.folder(options)
    if not options.charts_only:  # before the charts, whose replaced meshes PyBullet keeps in memory
        outcomes = run_matrix(quick=options.quick, methods=options.methods)
        draw_matrix(CHARTS.images(out) / "stability.png", outcomes)
        real_maps = out / "images" / "real_maps"
        real_maps.mkdir(exist_ok=True)
        draw_box(real_maps / "box.png")
        save(CHARTS.data(out), {"stability": [outcome.record() for outcome in outcomes]})
        write_blocks(out / "stability.md", {"stability": matrix_table(outcomes)})
    if not options.matrix_only:
        chosen = configurations(quick=options.quick)
        scenes = CHARTS.chosen(options, read_scenes())
        captions = {f"{scene.title} ({scene.bodies.count} bodies)": scene for scene in scenes}
        results, blocks = CHARTS.run(out, captions, lambda scene: run_scene(scene, chosen))
        if README_SCENE in results:
            draw_readme(CHARTS.images(out) / "readme.png", results[README_SCENE])
        print("\n" + blocks["summary"])
        CHARTS.write(out, blocks)
    return 0


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    found = CHARTS.parser(__doc__, [scene.name for scene in read_scenes()])
    found.add_argument("--methods", nargs="+", default=[], choices=list(METHODS), help="these columns of the matrix")
    found.add_argument("--charts-only", action="store_true", help="no stability matrix")
    found.add_argument("--matrix-only", action="store_true", help="the stability matrix alone")
    return found


def setup_of(scene: Scene, heights: Any, rate: float, starts: Sequence[BodyState]) -> Setup:
    """Return the bodies of a scene at ``starts``, on ground of ``heights`` (R, C) [m] that does not slide, for steps at
    a ``rate`` [Hz]."""
    shape: Any = scene.bodies.make_shape()
    bodies = [EngineBody(shape=shape, state=state, friction=scene.bodies.friction) for state in starts]
    return Setup(heights=heights, resolution=scene.grid[1], bodies=bodies, dt=1.0 / rate)


class BodyContest(Contest):
    """A scene of the accuracy study."""

    scene: Scene
    pieces = 12
    patience: ClassVar[float] = 2.5

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, scene.make_ground(), scene.bodies.count)
        self._shape, self._truth = scene.bodies.make_shape(), scene.make_ground()

    def enter(self, configuration: Configuration) -> Engine:
        setup = setup_of(self.scene, self.maps(0), configuration.rate, self.scene.starts())
        engine: Engine = configuration.build(replace(setup, slide=self.scene.slide))
        return engine

    def measure(self, instant: float, runners: Sequence[Runner]) -> None:
        surface = self.scene.surface(self._truth.heights(instant), instant)
        for runner in runners:
            sample = runner.samples[instant]
            positions, orientations = (frames[:, 0] for frames in sample.links)
            ground = surface.below(positions)
            sample.below = positions[:, 2] < ground
            if instant > self.scene.settle:
                sample.clearance = clearances(surface, self._shape, positions, orientations)
                sample.clearance[np.isnan(ground)] = np.nan

    def reference(self) -> FloatArray | None:
        """The collider is a filtered trimesh of the whole map on rigid ground. On moving ground, where a whole collider
        cannot carry the velocity, it is ours with an eighth of the step and a map at every step. Sliding rigid ground
        is simulated in the frame of the ground, where the ground is at rest and the bodies have the opposite
        velocity."""
        scene, ground = self.scene, self.scene.make_ground()
        if scene.reference == "none":
            return None
        against = (-scene.slide[0], -scene.slide[1], 0.0)
        starts = [replace(state, linear=tuple(np.add(state.linear, against).tolist())) for state in scene.starts()]
        setup = setup_of(scene, ground.heights(0.0), FINE_RATE, starts)
        if scene.reference == "whole":
            found = build("bullet_trimesh", setup, edge_filter=True)
        else:  # a map arrives at every step, so short intervals must not merge maps
            found = build("smartmesh", setup, motion=MotionConfig(min_interval=0.0))
        maps = range(round(FINE_RATE)) if scene.moves and scene.reference == "finest" else range(0)
        return np.asarray(self.places_in(found, ground, maps) - HORIZON * np.array(against))


def run_scene(scene: Scene, chosen: Sequence[Configuration]) -> dict[str, Result]:
    """Run a scene in every configuration that suits it."""
    suited = [configuration for configuration in chosen if scene.slide != (0.0, 0.0) or not configuration.for_sliding]
    return run(BodyContest(scene), suited)
