"""Colliders of the whole main mesh (Simple-Mesh, Table 1), and local colliders of one body or of a crowd (Tables 2, 3
and 6): everything an update does, search and collecting too."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from smartmesh_ros import InputError
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.bench.measure import LONGEST_FRAME, Before, Bench
from studies.bench.moving import FRAME, RADIUS, RESOLUTION, Player, Waves, general_mesh, grid_vertices, height_map
from studies.bench.report import LARGER, RINGS, SIMPLE_PHYSX
from studies.engines.engine import Setup, build, missing
from studies.report.config import ReportConfig

# Main mesh of the measurements that vary the collider [vertices on a side].
SIDE = 200
# Sizes of the main mesh, ascending.
SIDES = (25, 50, 100, 150, 200, *LARGER)
# The largest general mesh: its graph is built from its triangles, which takes a while.
LARGEST_GENERAL = 512

# The report's own colliders: triangle meshes built anew, in the kinds of the mesh they are cut from.
REPORT = ReportConfig(kind="trimesh", rings=1, carry_velocity=False)
UNIFORM = ReportConfig(kind="heightfield", rings=1)


def measure_main_meshes(bench: Bench, side: int) -> None:
    """One body on a main mesh of ``side`` x ``side``: the report's trimesh patch and today's heightfield patch."""
    waves = Waves(side)
    for method, patch in (("trimesh", REPORT), ("heightfield", UNIFORM)):
        Player(waves, height_map(waves), patch).time(bench, ("smart", method, side))
    if side <= LARGEST_GENERAL:
        general = Player(waves, general_mesh(waves), replace(REPORT, search="brute_force"))
        general.time(bench, ("smart", "general", side))
    _measure_physx(bench, waves)


def _measure_physx(bench: Bench, waves: Waves) -> None:
    """The report's Smart-Mesh in PhysX: a patch of 3 x 3 is searched and collected by this package, cooked by PhysX.

    The ball has no collider under it and falls; its patch stays over it all the same.
    """
    if missing("physx"):
        return
    player = Player(waves, height_map(waves), UNIFORM)
    ground = player.world.ground
    ball = ground.followers[0].body
    ground.detach(ball)
    ground.attach(ball, radius=RADIUS, solid=False)  # a patch without a collider in PyBullet
    setup = Setup(heights=np.zeros((3, 3)), resolution=RESOLUTION, bodies=(), dt=FRAME)
    with player.world as world, build("physx", setup) as engine:

        def update() -> None:
            world.refresh()
            engine.set_ground(ground.chosen.batches[0].vertices_w[0, :, 2].reshape(3, 3))

        bench.time(("smart", "physx", waves.side), update, player.next_frame)


# A crowd, on a larger map [vertices on a side].
BATCH, BATCH_SIDE = 100, 1024


def measure_local_colliders(bench: Bench) -> None:
    """Colliders of several sizes: of varying shape (triangles found anew), of constant shape, and heightfields, these
    also in updates of a batch."""
    waves, wide = Waves(SIDE), Waves(BATCH_SIDE)
    for rings in bench.some(RINGS):
        constant, plain = replace(REPORT, rings=rings), replace(UNIFORM, rings=rings)
        varying = replace(constant, collect="union_bfs")
        for method, config in (("varying", varying), ("constant", constant), ("heightfield", plain)):
            mesh = general_mesh(waves) if method == "varying" else height_map(waves)
            Player(waves, mesh, config).time(bench, ("local", method, rings))
        Player(wide, height_map(wide), plain, BATCH).time(bench, ("update", "heightfield", rings))


def measure_general(bench: Bench) -> None:
    """Measure, on a general mesh whose vertices all move, taking them in, and the update of one body with each suitable
    search."""
    waves = Waves(SIDE)
    mesh = general_mesh(waves)
    frames = Waves(SIDE, grid_vertices)
    times = count()
    bench.time(("ingest", "mesh", SIDE), lambda: mesh.move(frames.now, time=0.05 * next(times)), frames.next)
    base = ReportConfig(kind="trimesh", rings=1)
    for search in ("brute_force", "best_first"):
        for collect in ("cached", "union_bfs"):
            player = Player(waves, general_mesh(waves), replace(base, search=search, collect=collect))
            player.time(bench, ("general", f"{search} {collect}", SIDE))


# Makes heights of the precision of most engines.
doubles = partial(np.asarray, dtype=np.float64)
ENGINES = ("physx", "bullet_trimesh", "bullet_heightfield", "mujoco")
# Sizes of the whole mesh, ascending [vertices on a side].
WHOLE_SIDES = (*SIMPLE_PHYSX, *LARGER)
# What a frame of an update runs, and what goes on to the next frame before it.
Update = tuple[Callable[[], object], Before]


def measure_whole(bench: Bench, name: str) -> None:
    """Measure updates of the whole collider in one engine, or of one of coal's hierarchies alone, up to the size at
    which a frame takes too long."""
    before = 0
    for side in bench.some(WHOLE_SIDES):
        longest = bench.us("simple", name, before) * (side / before) ** 2 if before else 0.0
        if longest > LONGEST_FRAME * 1e6:
            return
        try:
            with ExitStack() as stack:
                run, prepare = COAL[name](Waves(side)) if name in COAL else _in_engine(name, Waves(side), stack)
                bench.time(("simple", name, side), run, prepare)
        except (ImportError, InputError) as error:  # not installed, or larger than the engine takes
            bench.left_out[f"{name} {side}x{side}" if before else name] = str(error)
            return
        before = side


def _in_engine(name: str, waves: Waves, stack: ExitStack) -> Update:
    setup = Setup(heights=doubles(waves.now), resolution=RESOLUTION, bodies=(), dt=FRAME)
    engine = stack.enter_context(build(name, setup))
    maps = Waves(waves.side, engine.ready)
    return lambda: engine.set_ground(maps.now), maps.next


def _bvh(waves: Waves) -> Callable[[], Any]:
    """Return what builds a hierarchy of bounding volumes."""
    import coal

    triangles, vertices = grid_triangles(waves.side, waves.side), grid_vertices(waves.next())

    def built() -> Any:
        model = coal.BVHModelOBBRSS()
        model.beginModel(len(triangles), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(triangles)
        model.endModel()
        return model

    return built


def _refitted(waves: Waves) -> Update:
    import coal

    model = _bvh(waves)()
    # Two frames in coal's own kind of list, because making one takes longer than the refit.
    frames = [coal.StdVec_Vec3s() for _ in range(2)]
    for frame in frames:
        frame.extend(list(grid_vertices(waves.next())))

    def refit() -> None:
        frames.reverse()
        model.beginReplaceModel()
        model.replaceSubModel(frames[0])
        model.endReplaceModel(True, True)

    return refit, None


def _field(waves: Waves) -> Update:
    import coal

    frames, extent = Waves(waves.side, doubles), (waves.side - 1) * RESOLUTION
    field = coal.HeightFieldOBBRSS(extent, extent, frames.now, -10.0)
    return lambda: field.updateHeights(frames.now), frames.next


# Bounding volume hierarchies alone: rebuilt, refitted, and the heights of a height field replaced.
COAL: dict[str, Callable[[Waves], Update]] = {
    "coal_rebuild": lambda waves: (_bvh(waves), None), "coal_refit": _refitted, "coal_heightfield": _field
}  # fmt: skip
