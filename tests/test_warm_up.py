"""Nothing is compiled inside a running loop."""

import subprocess
import sys
from pathlib import Path

import pytest

from smartmesh_ros import compiled

SCRIPT = """
import gc

import numpy as np
from numba.core.dispatcher import Dispatcher

from smartmesh_ros import (
    BodyState, Box, Capsule, Cylinder, HeightMap, PatchConfig, Sphere, Terrain, World, WorldConfig
)
from smartmesh_ros.physics.states import simulated_states
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from smartmesh_ros.warm_up import warm_up


def signatures():
    return {
        (found.py_func.__qualname__, str(signature))
        for found in gc.get_objects() if isinstance(found, Dispatcher) for signature in found.signatures
    }


def hills(side, time):
    row, column = np.mgrid[:side, :side]
    return (0.2 * np.sin(0.5 * row + 3.0 * time) * np.cos(0.4 * column)).astype(np.float32)


def spawn(world):
    shapes = Sphere(0.2), Box(0.4, 0.3, 0.2), Capsule(0.1, 0.3), Cylinder(0.2, 0.3), Sphere(1.0)
    for place, shape in enumerate(shapes):
        world.spawn(f"body_{place}", shape, 1.0, BodyState((1.0 + 1.5 * place, 4.0, 1.5)))
    world.spawn("below", Sphere(0.2), 1.0, BodyState((5.0, 6.0, -2.0)))
    world.spawn("fast", Sphere(0.1), 1.0, BodyState((5.0, 7.0, 3.0), linear=(0.0, 0.0, -40.0)))
    world.spawn_robot("rover", ROVER, BodyState((3.0, 2.0, 1.0)))
    world.track("dictated", 0.3, BodyState((6.0, 2.0, 0.2)))


def run(terrain, patch, change, steps=100):
    with World(terrain, WorldConfig(patch=patch)) as world, World() as other:
        spawn(world)
        other.spawn("guest", Sphere(0.3), 1.0, BodyState((5.0, 4.0, 0.5)))
        for step in range(steps):
            world.guests.take("peer", simulated_states(other), world.time)
            if step % 4 == 0:
                change(world, step)
            world.step()
            if step % 10 == 0:
                world.shown_batches(), world.contacts(), world.wrenches(), world.below_ground()
                world.ground_at([[4.0, 4.0]]), world.cast_rays([[4.0, 4.0, 3.0]], [[0.1, 0.0, -1.0]], 9.0)


def run_alone():
    # A single body, which falls, comes to rest and sleeps, before a guest comes beside it: tables of one row.
    with World(HeightMap(np.zeros((40, 40)), resolution=0.25)) as world, World() as other:
        world.spawn("alone", Sphere(0.2), 1.0, BodyState((5.0, 4.0, 0.6)))
        other.spawn("guest", Sphere(0.3), 1.0, BodyState((5.5, 4.0, 0.5)))
        for step in range(400):
            if step >= 300:
                world.guests.take("peer", simulated_states(other), world.time)
            world.step()
            assert step != 299 or world.is_asleep("alone")


def whole(world, step):
    heights = hills(40, world.time)
    world.terrain.tiles[""].replace(heights if step % 8 else heights.astype(float), time=world.time)


def from_bytes(world, step):
    heights = np.frombuffer(hills(40, world.time).tobytes(), np.float32).reshape(40, 40)
    world.terrain.tiles[""].replace(heights, time=world.time, velocities=heights)
    world.terrain.tiles[""].update_region(3, 4, heights[:5, :6], time=world.time + 0.001)


def sliding(world, step):
    world.terrain.put("", HeightMap(hills(40, 0.0), resolution=0.25, origin=(0.01 * step, 0.0), time=world.time))


def vertices(time):
    row, column = np.mgrid[:40, :40]
    return np.stack([0.25 * column, 0.25 * row, hills(40, time)], axis=-1).reshape(-1, 3)


def mesh(world, step):
    world.terrain.tiles[""].move(vertices(world.time), time=world.time)


warm_up()
before = signatures()
assert len(before) > 10, before
for kind in "auto", "heightfield", "trimesh", "hull", "prisms":
    # PyBullet makes prisms anew at every change, some hundred for the largest ball, which takes a second for ten steps.
    run(HeightMap(hills(40, 0.0), resolution=0.25), PatchConfig(kind=kind), whole, 24 if kind == "prisms" else 100)
run(HeightMap(hills(40, 0.0), resolution=0.25, yaw=0.3), PatchConfig(kind="heightfield", rings=2), from_bytes)
run(HeightMap(hills(40, 0.0), resolution=0.25), PatchConfig(carry_velocity=False), sliding)
run(HeightMap(np.zeros((40, 40)), resolution=0.25), PatchConfig(rate=0.0), lambda world, step: None)
tiles = Terrain(HeightMap(hills(40, 0.0), resolution=0.25))
tiles.put("beside", HeightMap(hills(40, 0.0), resolution=0.25, origin=(0.0, 39 * 0.25)))
run(tiles, PatchConfig(), whole)
run(TriangleMesh(vertices(0.0), grid_triangles(40, 40)), PatchConfig(search="brute_force"), mesh)
run_alone()
after = signatures()
assert after == before, sorted(after - before)
"""
ROVER = Path(__file__).parent / "data/rover.urdf"


@pytest.mark.skipif(compiled.numba is None or compiled.numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_hundred_steps_with_every_kind_of_body_compile_nothing() -> None:
    script = SCRIPT.replace("ROVER", repr(str(ROVER)))
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
