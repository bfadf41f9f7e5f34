"""The comparison with another checkout: the other process does what this one would, and the figures are its own."""

from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, PhysicsConfig, Sphere, World, WorldConfig
from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.evaluation.scene import Bodies, Scene
from studies.body_contest import run_scene
from studies.configurations import checkouts
from studies.engines.checkout import Checkout
from studies.engines.engine import EngineBody, Setup

DT = 1.0 / 240.0
SMALL = Scene(
    name="small", title="Small", ground={"kind": "waves", "amplitude": 0.25, "number": 1.5, "frequency": 4.0},
    grid=(41, 0.25), bodies=Bodies(count=3, spread=(2.0, 2.0)), map_rate=60.0, duration=0.5, settle=0.25,
    samples=24.0, reference="none",
)  # fmt: skip


def test_another_checkout_of_the_same_code_moves_bodies_like_this_one() -> None:
    heights = 0.1 * np.sin(np.arange(21)[:, np.newaxis] + 0.5 * np.arange(31))
    bodies = [
        EngineBody(shape=Sphere(0.25), mass=2.0, state=BodyState((1.3, 2.9, 0.5), linear=(1.0, 0.0, 0.0))),
        EngineBody(shape=Box(0.4, 0.6, 0.3), state=BodyState((4.1, 1.1, 0.5)), friction=0.8, restitution=0.2),
    ]
    heightmap = HeightMap(heights, resolution=0.2)
    setup = Setup(heights=heights, resolution=0.2, bodies=bodies, dt=DT)
    with World(heightmap, WorldConfig(physics=PhysicsConfig(rate=240.0))) as world, Checkout(setup) as other:
        for index, body in enumerate(bodies):
            world.spawn(f"body_{index}", body.shape, body.mass, body.state)
            uid = world.bodies[f"body_{index}"].uid
            world.client.changeDynamics(uid, -1, lateralFriction=body.friction, restitution=body.restitution)
        for step in range(120):
            if step % 4 == 3:
                heightmap.replace(heights + 1e-3 * step, time=world.time)
                other.set_ground(heights + 1e-3 * step)
            world.step()
            other.step()
        here = [world.client.getBasePositionAndOrientation(body.uid) for body in world.bodies.values()]
        np.testing.assert_array_equal(other.poses(), [(*position, *orientation) for position, orientation in here])
        update, step_time = other.taken()
        assert update > 0.0 and step_time > 0.0
        assert other.taken() == (0.0, 0.0)


def test_a_folder_without_the_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no smartmesh_ros"):
        Checkout(Setup(heights=np.zeros((9, 9)), resolution=0.5, bodies=[], dt=DT), folder=tmp_path)


def test_code_that_cannot_run_a_scene_says_why(tmp_path: Path) -> None:
    (tmp_path / "smartmesh_ros").mkdir()
    (tmp_path / "smartmesh_ros" / "__init__.py").write_text("class HeightMap: ...\n")
    found = run_scene(SMALL, checkouts(tmp_path), lambda _: None)
    assert found["defaults"].note == "" and "HeightMap() takes no arguments" in found["before"].note
