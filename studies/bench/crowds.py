"""Many bodies at once: collider updates, a general mesh, and other engines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import BodyState
from studies.bench.measure import Bench, Case
from studies.bench.moving import (
    RADIUS,
    RESOLUTION,
    Cycle,
    Player,
    Waves,
    crowd_positions,
    doubles,
    general_mesh,
    grid_vertices,
    height_map,
)
from studies.bench.report import RINGS
from studies.engines.engine import EngineBody, Setup, build, missing
from studies.report.config import ReportConfig

SIDE = 1024
BATCH = 100
MESH_SIDE = 200
DT = 1.0 / 240.0


class Scale(NamedTuple):
    """A comparison of engines: which, on a map of how many samples a side and what resolution [m], with balls of what
    radius [m]."""

    engines: tuple[str, ...]
    side: int
    resolution: float
    radius: float


# A map of the report's size whose cells are as large as the balls, and one with fine cells.
COARSE = Scale(("smartmesh", "mujoco", "physx", "bullet_heightfield", "bullet_trimesh"), 200, RESOLUTION, RADIUS)
FINE = Scale(("smartmesh", "mujoco"), 1001, 0.02, 0.3)


def measure_updates(bench: Bench) -> None:
    """Updates of a batch of heightfield patches by their size, all in."""
    waves = Waves(SIDE)
    for rings in bench.effort.of(RINGS):
        player = Player(waves, height_map(waves), ReportConfig(kind="heightfield", rings=rings), BATCH)
        with player.world as world:
            runs = {
                Case("update", "heightfield", SIDE, BATCH, rings): world.refresh,
                Case("replace", "heightfield", SIDE, BATCH, rings): _replacements(world.client, rings),
            }
            bench.race(runs, player.next_frame)


def _replacements(client: Any, rings: int) -> Callable[[], None]:
    """Measure PyBullet's replacement of the batch's heightfields alone, the lower bound of an update."""
    size = 2 * rings + 1
    heights = np.random.default_rng(1).uniform(-0.1, 0.1, (2, size * size)).tolist()
    layout = {"shapeType": pb.GEOM_HEIGHTFIELD, "numHeightfieldRows": size, "numHeightfieldColumns": size}
    shape = client.createCollisionShape(meshScale=[RESOLUTION, RESOLUTION, 1.0], heightfieldData=heights[0], **layout)

    def run() -> None:
        heights.reverse()
        for _ in range(BATCH):
            client.createCollisionShape(heightfieldData=heights[0], replaceHeightfieldIndex=shape, **layout)

    return run


def measure_batches(bench: Bench, count: int) -> None:
    """The update of 5 x 5 patches by the number of bodies."""
    waves = Waves(SIDE)
    Player(waves, height_map(waves), ReportConfig(kind="heightfield", rings=2), count).time(
        bench, Case("update", "heightfield", SIDE, count, 2)
    )


def measure_general(bench: Bench) -> None:
    """Measure, on a general mesh whose vertices all move, taking them in, and the update of one body with each suitable
    search."""
    waves = Waves(MESH_SIDE)
    mesh = general_mesh(waves)
    frames = waves.converted(grid_vertices)
    times = count()
    bench.time(Case("ingest", "mesh", MESH_SIDE), lambda: mesh.move(frames.now, time=0.05 * next(times)), frames.next)
    base = ReportConfig(kind="trimesh", rings=1)
    for search in ("brute_force", "best_first"):
        for collect in ("cached", "union_bfs"):
            Player(waves, general_mesh(waves), replace(base, search=search, collect=collect)).time(
                bench, Case("general", f"{search} {collect}", MESH_SIDE)
            )


def measure_engines(bench: Bench, scale: Scale, count: int) -> None:
    """Measure, by engine, a new map at every step under ``count`` balls: map update, colliders and step."""
    for name in scale.engines:
        if missing(name):
            bench.results.left_out[name] = missing(name)
            continue
        waves = Waves(scale.side, scale.resolution, DT)
        places = crowd_positions(count, scale.side, scale.resolution)
        column, row = np.round(places / scale.resolution).astype(int).T
        heights = waves.now[row, column] + scale.radius + 0.02
        bodies = [
            EngineBody(shape=Sphere(scale.radius), state=BodyState((x, y, z)))
            for (x, y), z in zip(places.tolist(), heights.tolist(), strict=True)
        ]
        setup = Setup(heights=doubles(waves.now), resolution=scale.resolution, bodies=bodies, dt=DT)
        with build(name, setup) as engine:
            maps = waves.converted(engine.ready)
            bench.time(Case("engines", name, scale.side, count), partial(_step, engine, maps), maps.next)


def _step(engine: Any, maps: Cycle[Any]) -> None:
    engine.set_ground(maps.now)
    engine.step()
