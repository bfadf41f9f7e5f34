"""The same inputs give the same world, to the last bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from smartmesh_ros import BodyState, Box, GridGeometry, HeightMap, Sphere, World
from smartmesh_ros.scenes.moving import InwardWaves, Wave
from smartmesh_ros.world.joints import JointCommand
from tests.grounds import step_on_moving
from tests.urdfs import HUSKY

GEOMETRY = GridGeometry(rows=61, columns=61, resolution=0.2, origin=(-6.0, -6.0, 0.0))
SCENE = InwardWaves(GEOMETRY, Wave(0.2, 1.0, 4.0))


def ground() -> HeightMap:
    return HeightMap(SCENE.heights(0.0), geometry=GEOMETRY)


def populate(world: World) -> None:
    rng = np.random.default_rng(5)
    for index in range(12):
        x, y = rng.uniform(-4.0, 4.0, 2)
        world.spawn(f"body_{index}", Sphere(0.2) if index % 2 else Box(0.3, 0.2, 0.4), 1.0, BodyState((x, y, 1.0)))
    world.spawn_robot("rover", HUSKY, BodyState((0.0, 0.0, 1.0)))
    world.drive("rover", "front_left_wheel", 3.0)
    world.command("rover", "rear_left_wheel", JointCommand(effort=1.5))
    world.track("hand", 0.3, BodyState((2.0, 2.0, 0.5), linear=(0.1, 0.0, 0.0)))


def run(world: World, steps: int) -> None:
    step_on_moving(world, SCENE.heights, steps, every=1)


def digest() -> str:
    with World(ground()) as world:
        populate(world)
        run(world, 120)
        return world.snapshot().hash


def test_the_same_inputs_give_the_same_hash_in_this_process_and_in_another() -> None:
    first = digest()
    assert digest() == first
    folder = Path(__file__).parent
    code = f"import sys; sys.path.insert(0, {str(folder)!r}); import test_snapshot as t; print('hash', t.digest())"
    output = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    ).stdout
    assert f"hash {first}" in output


def test_rewinding_and_repeating_gives_the_same_hash() -> None:
    with World(ground()) as world:
        populate(world)
        run(world, 60)
        saved = world.save()
        hashes = []
        for _ in range(2):
            world.restore(saved)
            run(world, 90)
            hashes.append(world.snapshot().hash)
        assert hashes[0] == hashes[1]
