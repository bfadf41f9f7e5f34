"""Many bodies at once: collider updates, whole steps, taking maps in, and other engines beside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.shapes import Sphere
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.studies.bench.measure import Bench, Case
from smartmesh_ros.studies.bench.moving import (
    RADIUS,
    RESOLUTION,
    Player,
    Waves,
    crowd_positions,
    general_mesh,
    grid_vertices,
    height_map,
)
from smartmesh_ros.studies.bench.report import RINGS
from smartmesh_ros.studies.engines.engine import EngineBody, Setup
from smartmesh_ros.studies.engines.registry import build, missing

SIDE = 1024
BATCH = 100
MESH_SIDE = 200
REGION = 64
# Map of the comparison of engines: the largest all of them can take, of about the report's size.
ENGINES_SIDE = 200
ENGINES = ("smartmesh", "mujoco", "physx", "bullet_heightfield", "bullet_trimesh")
DT = 1.0 / 240.0


def measure_updates(bench: Bench) -> None:
    """Updates of a batch of heightfield patches by their size, all in, without and with the edge filter."""
    waves = Waves(SIDE)
    for rings in RINGS:
        for method, edge_filter in (("unfiltered", False), ("filtered", True)):
            patch = PatchConfig(kind="heightfield", rings=rings, edge_filter=edge_filter)
            player = Player(waves, height_map(waves), patch, BATCH)
            with player.world as world:
                bench.time(Case("update", method, SIDE, BATCH, rings), world.refresh, player.next_frame)


def measure_steps(bench: Bench, count: int, rate: float) -> None:
    """Update and step of ``count`` bodies with the default patches, on maps that come at 60 Hz and are not timed."""
    waves = Waves(SIDE)
    player = Player(waves, height_map(waves), PatchConfig(), count, rate)
    with player.world as world:
        bench.time(Case("step", f"{rate:g} Hz", SIDE, count), world.step, player.move_ground)


def measure_batches(bench: Bench, count: int) -> None:
    """The update of 5 x 5 patches by the number of bodies."""
    waves = Waves(SIDE)
    player = Player(waves, height_map(waves), PatchConfig(kind="heightfield", rings=2, edge_filter=False), count)
    with player.world as world:
        bench.time(Case("update", "unfiltered", SIDE, count, 2), world.refresh, player.next_frame)


def measure_ingest(bench: Bench) -> None:
    """Taking in a whole map, a region of a map, and the vertices of a general mesh."""
    waves = Waves(SIDE)
    heightmap = height_map(waves)
    region = np.full((REGION, REGION), 0.1, np.float32)
    time = [0.0]

    def advance() -> None:
        time[0] += 0.05

    bench.time(Case("ingest", "map", SIDE), lambda: heightmap.replace(waves.next(), time=time[0]), advance)
    bench.time(Case("ingest", "region", SIDE), lambda: heightmap.update_region(401, 333, region, time=time[0]), advance)
    waves = Waves(MESH_SIDE)
    mesh = general_mesh(waves)
    frames = [grid_vertices(waves.next()) for _ in range(2)]

    def next_vertices() -> None:
        advance()
        frames.reverse()

    bench.time(Case("ingest", "mesh", MESH_SIDE), lambda: mesh.move(frames[0], time=time[0]), next_vertices)


def measure_general(bench: Bench) -> None:
    """One body on a general mesh whose vertices all move: the update by each search that works there."""
    waves = Waves(MESH_SIDE)
    base = PatchConfig(kind="trimesh", rings=1, edge_filter=False)
    for search in ("brute_force", "best_first"):
        for collect in ("cached", "union_bfs"):
            player = Player(waves, general_mesh(waves), replace(base, search=search, collect=collect))
            with player.world as world:
                bench.time(Case("general", f"{search} {collect}", MESH_SIDE), world.refresh, player.next_frame)


def measure_engines(bench: Bench, count: int) -> None:
    """A map of 200 x 200 that changes at every step under ``count`` balls: taking it in and the step, by engine."""
    for name in ENGINES:
        if missing(name):
            bench.results.left_out[name] = missing(name)
            continue
        waves = Waves(ENGINES_SIDE)
        frames = [waves.next().astype(np.float64)]
        places = crowd_positions(count, ENGINES_SIDE)
        column, row = np.round(places / RESOLUTION).astype(int).T
        height = frames[0][row, column] + RADIUS + 0.02
        bodies = [
            EngineBody(shape=Sphere(RADIUS), state=BodyState((x, y, z)))
            for (x, y), z in zip(places.tolist(), height.tolist(), strict=True)
        ]
        setup = Setup(heights=frames[0], resolution=RESOLUTION, bodies=bodies, dt=DT)
        try:
            engine = build(name, setup)
        except InputError as error:
            bench.results.left_out[f"{name} {count} bodies"] = str(error)
            continue
        with engine:

            def advance(waves: Waves = waves, frames: list = frames) -> None:  # type: ignore[type-arg]
                frames[0] = waves.next().astype(np.float64)

            def run(engine=engine, frames: list = frames) -> None:  # type: ignore[no-untyped-def,type-arg]
                engine.set_ground(frames[0])
                engine.step()

            bench.time(Case("engines", name, ENGINES_SIDE, count), run, advance)
