"""Load every compiled function before its first use, or compile it if no machine code exists."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from smartmesh_ros import machine_code
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.shapes import DIRECTIONS, directions, hull
from smartmesh_ros.physics.shapes import Box, Cylinder, Sphere
from smartmesh_ros.physics.sleep_config import SleepConfig
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.physics.states import simulated_states
from smartmesh_ros.physics.world import World, WorldConfig
from smartmesh_ros.soil.bodies import FootShape, GivenBodies
from smartmesh_ros.soil.config import SoilConfig, SoilType
from smartmesh_ros.soil.soil import Load, Soil
from smartmesh_ros.terrain.fusion import FusionConfig, fuse, nothing_known
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.noise_check import NoiseCheck
from smartmesh_ros.terrain.surface_query import checked_points, ground_samples
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles

# Samples along each side of the maps, and their spacing [m].
SIDE, SPACING = 8, 0.25
LENGTH = (SIDE - 1) * SPACING
SOIL = SoilType(
    Bekker_Kphi=1e6, Bekker_Kc=0.0, Bekker_n=1.0, Mohr_cohesion=1e3, Mohr_friction=30.0, Janosi_shear=0.01
)  # fmt: skip


def warm_up() -> float:
    """Compile all functions in separate processes if that is not done yet, and load them; return the elapsed time [s].

    Call this before stepping a `World` or updating a `Ground` in real time. Otherwise the first steps take that time.
    """
    start = perf_counter()
    machine_code.prepare()
    run_through()
    return perf_counter() - start


def run_through() -> None:
    """Call all compiled functions on maps of a few samples."""
    with World() as world:
        _spawn_bodies(world)
        for scene in (_on_hills, _on_corrected_ground, _on_a_plane, _across_tiles, _on_a_general_mesh):
            scene(world)
            world.step(2)
            world.shown_batches()
            _ask(world)
            world.reset_bodies()
        _with_remote_bodies(world)
    with World(config=WorldConfig(patch=PatchConfig(kind="heightfield"))) as world:
        _spawn_bodies(world)
        _on_hills(world)
        world.step(2)
        _with_remote_bodies(world)
    _with_sleeping_bodies()
    _ask_in_a_gap()
    hull(directions(2 * len(DIRECTIONS)))
    _fuse_maps()
    _check_maps()
    press_soil()


def press_soil() -> None:
    """Press a box into soil, with and without a known place of its load."""
    ground = HeightMap(np.zeros((SIDE, SIDE)), resolution=SPACING)
    bodies = GivenBodies()
    soil = Soil(ground, SOIL, bodies, SoilConfig(flow=0.5, slides=1))
    place = 0.5 * LENGTH
    bodies.put("box", FootShape("box", (SPACING,) * 3), (place, place, 0.5 * SPACING, 0, 0, 0, 1, *([0.0] * 6)))
    for number, load in enumerate((Load(1e4), Load(1e4, place, place), Load(0.0))):
        for region in soil.press({"box": load}, 0.01, 0.01 * number):
            ground.update_region(*region[:3], time=0.01 * number, velocities=region.velocities)
    soil.apply([], 0.01, 0.03)


def _spawn_bodies(world: World) -> None:
    """Spawn shapes of each kind: one about to hit the ground, one on two tiles, one below the ground, one tracked."""
    middle = 0.5 * LENGTH
    world.spawn("falling", Sphere(0.1), 1.0, BodyState((middle, middle, 0.25), linear=(0.0, 0.0, -20.0)))
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.3 * LENGTH, middle, 0.15)))
    world.spawn("cylinder", Cylinder(0.1, 0.2), 1.0, BodyState((0.7 * LENGTH, middle, 0.15)))
    world.spawn("on two tiles", Sphere(0.1), 1.0, BodyState((LENGTH, middle, 0.1)))
    world.spawn("below", Sphere(0.1), 1.0, BodyState((middle, 0.3 * LENGTH, -0.5)))
    world.track("dictated", 0.1, BodyState((middle, 0.7 * LENGTH, 0.1)))


def _on_hills(world: World) -> None:
    """Use a sliding map after whole and partial updates, with and without velocities."""
    hills = _hills(0.0)
    hills.replace(hills.heights, time=-0.3)
    hills.update_region(1, 1, hills.heights[1:3, 1:3], time=-0.2)
    hills.replace(hills.heights, time=-0.1, velocities=np.ones((SIDE, SIDE), np.float32))
    hills.slide((1.0, 0.0), 0.1)
    hills.sample(np.arange(SIDE), 0.0)
    world.terrain.put("", hills)


def _on_corrected_ground(world: World) -> None:
    """Use static ground whose second map is a correction."""
    motion = MotionConfig(changes="correction")
    hills = HeightMap(_hills(0.0).heights, resolution=SPACING, motion=motion)
    hills.show(world.time)
    hills.replace(hills.heights + np.float32(0.01), time=world.time)
    world.terrain.put("", hills)


def _on_a_plane(world: World) -> None:
    """Use flat ground at rest."""
    world.terrain.put("", HeightMap(np.zeros((SIDE, SIDE), np.float32), resolution=SPACING, time=world.time))


def _across_tiles(world: World) -> None:
    """Use two tiles."""
    world.terrain.put("", _hills(0.0))
    world.terrain.put("beside", _hills(LENGTH))


def _on_a_general_mesh(world: World) -> None:
    """Use a triangle mesh."""
    world.terrain.remove("beside")
    rows, columns = np.mgrid[:SIDE, :SIDE]
    vertices = SPACING * np.stack([columns, rows, 0.1 * rows], axis=-1).reshape(-1, 3)
    mesh = TriangleMesh(vertices, grid_triangles(SIDE, SIDE), time=-1.0)
    mesh.move(vertices, time=0.0)
    world.terrain.put("", mesh)


def _hills(x: float) -> HeightMap:
    """Return a height map that is nowhere flat and starts at ``x`` [m]."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    heights = 0.1 * np.sin(rows) * np.cos(columns)
    return HeightMap(heights.astype(np.float32), resolution=SPACING, origin=(x, 0.0), time=-1.0)


def _with_remote_bodies(world: World) -> None:
    """Simulate a remote body that rests on a local one, until it is corrected towards its owner's states."""
    with World() as other:
        other.spawn("guest", Sphere(0.1), 1.0, world.state("box"))
        for _ in range(8):
            world.guests.take("peer", simulated_states(other), world.time)
            world.step()
    world.guests.clear()


def _with_sleeping_bodies() -> None:
    """Put bodies to sleep as soon as they touch the ground, and wake one by its ground and the others by a body that
    comes near."""
    ground = HeightMap(np.zeros((SIDE, SIDE), np.float32), resolution=SPACING, time=-1.0)
    with World(ground, WorldConfig(sleep=SleepConfig(after=0.0, distance=1.0))) as world:
        _spawn_bodies(world)
        world.step(60)
        ground.update_region(0, 0, np.full((2, 2), 0.01, np.float32), time=world.time)
        world.step()
        world.spawn("near", Sphere(0.1), 1.0, world.state("box"))
        world.remove("cylinder")
        world.step(2)


def _ask(world: World) -> None:
    """Ask for the ground at points, and cast rays."""
    middle = 0.5 * LENGTH
    world.ground_at([[middle, middle]])
    world.cast_rays([[middle, middle, 1.0]], [[0.0, 0.0, -1.0]], 2.0)


def _ask_in_a_gap() -> None:
    """Ask for the ground in a gap between two tiles."""
    terrain = Terrain(_hills(0.0))
    terrain.put("beside", _hills(LENGTH + SPACING))
    ground_samples(terrain, checked_points([[LENGTH + 0.5 * SPACING, 0.5 * LENGTH]]), 0.0)


def _fuse_maps() -> None:
    """Fuse maps with one variance for all samples, and with one for each sample."""
    heights = np.zeros((SIDE, SIDE), np.float32)
    for variance in (1e-4, np.full((SIDE, SIDE), 1e-4, np.float32)):
        fuse(nothing_known(SIDE, SIDE), heights, variance, 0.1, FusionConfig())


def _check_maps() -> None:
    """Check maps for noise: one map that stays in place, and one that travels by a cell."""
    check = NoiseCheck()
    hills = _hills(0.0)
    for x, time in ((0.0, 0.0), (0.0, 0.1), (SPACING, 0.2)):
        check.take(HeightMap(hills.heights, resolution=SPACING, origin=(x, 0.0), time=time), time)
