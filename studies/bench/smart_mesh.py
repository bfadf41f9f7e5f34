"""Local colliders of one body (Tables 2, 3 and 6, Figure 2): everything an update does, search and collecting too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from smartmesh_ros.patches.config import PatchConfig
from studies.bench.measure import Bench, Case
from studies.bench.moving import FRAME, RADIUS, RESOLUTION, Player, Waves, general_mesh, height_map
from studies.bench.report import LARGER, RINGS
from studies.engines.engine import Setup, build, missing

# Main mesh of the measurements that vary the collider [vertices on a side].
SIDE = 200
# The largest general mesh: its graph is built from its triangles, which takes a while.
LARGEST_GENERAL = 512

# The report's own colliders: triangle meshes built anew, in the kinds of the mesh they are cut from.
REPORT = PatchConfig(kind="trimesh", rings=1, carry_velocity=False)
UNIFORM = PatchConfig(kind="heightfield", rings=1)


def sides(quick: bool) -> tuple[int, ...]:
    """Sizes of the main mesh, ascending."""
    return (25, 50, 512) if quick else (25, 50, 100, 150, 200, *LARGER)


def measure_main_meshes(bench: Bench, side: int) -> None:
    """One body on a main mesh of ``side`` x ``side``: the report's trimesh patch and today's heightfield patch."""
    waves = Waves(side)
    for method, patch in (("trimesh", REPORT), ("heightfield", UNIFORM)):
        player = Player(waves, height_map(waves), patch)
        with player.world as world:
            bench.time(Case("smart", method, side), world.refresh, player.next_frame)
    if side <= LARGEST_GENERAL:
        player = Player(waves, general_mesh(waves), replace(REPORT, search="brute_force"))
        with player.world as world:
            bench.time(Case("smart", "general", side), world.refresh, player.next_frame)
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
            ground.patches.choose_tracked()
            engine.set_ground(ground.patches.batches[0].vertices_w[0, :, 2].reshape(3, 3))

        bench.time(Case("smart", "physx", waves.side), update, player.next_frame)


def measure_local_colliders(bench: Bench) -> None:
    """Colliders of several sizes: of varying shape (triangles found anew), of constant shape, and heightfields."""
    waves = Waves(SIDE)
    for rings in RINGS[:2] if bench.effort.quick else RINGS:
        varying = replace(REPORT, rings=rings, collect="union_bfs")
        constant = replace(REPORT, rings=rings)
        plain = replace(UNIFORM, rings=rings)
        for method, config in (("varying", varying), ("constant", constant), ("heightfield", plain)):
            mesh = general_mesh(waves) if method == "varying" else height_map(waves)
            player = Player(waves, mesh, config)
            with player.world as world:
                bench.time(Case("local", method, SIDE, rings=rings), world.refresh, player.next_frame)


def measure_frames(bench: Bench, side: int) -> None:
    """Whole frames as in Figure 2: the ground's vertices are moved, the collider updated, the physics stepped once."""
    waves = Waves(side)
    for method, patch in (("simple", PatchConfig(kind="whole_trimesh")), ("smart", UNIFORM)):
        player = Player(waves, height_map(waves), patch)
        with player.world:
            bench.time(Case("frame", method, side), player.next_frame)
