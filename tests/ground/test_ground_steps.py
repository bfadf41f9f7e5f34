"""`Ground.step` in a PyBullet world of the user's own: as safe as `World`, by the same code."""

import math
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Ground, HeightMap, InputError, Terrain, World
from smartmesh_ros.ground.config import PhysicsConfig, set_up
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.world.bodies import BodyFactory
from tests.bodies import height, put
from tests.grounds import level

DT = 1.0 / 240.0
BALL = Sphere(0.02)


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("shape", [Box(0.5, 0.4, 0.02), Cylinder(radius=0.2, height=0.02), Sphere(0.01)])
@pytest.mark.parametrize("cover", [0.015, 0.03])
def test_a_body_that_a_map_covers_is_lifted_onto_it_and_no_higher(
    client: Any, shape: Shape, maximal: bool, cover: float
) -> None:
    """By the shape that Bullet collides."""
    terrain, body = level(), put(client, shape, (0.013, 0.021, 0.01), useMaximalCoordinates=maximal)
    ground = Ground(client, terrain)
    ground.attach(body)
    heights = []
    for step in range(120):
        if step == 60:
            terrain.replace(terrain.heights + cover, time=step * DT + 100.0)  # long after: no velocity
        ground.step(step * DT, DT)
        heights.append(height(client, body))
    assert max(heights) == pytest.approx(cover + 0.01, abs=1e-3)
    assert heights[-1] == pytest.approx(cover + 0.01, abs=1e-4)


def test_bodies_that_physics_does_not_move_stay_where_they_are(client: Any) -> None:
    fixed, patched = put(client, BALL, (0.013, 0.021, -0.01), 0.0), put(client, BALL, (0.013, 0.021, -1.0))
    ground = Ground(client, level())
    ground.attach(fixed)
    ground.attach(patched, solid=False)
    ground.step(0.0, DT)
    assert height(client, fixed) == -0.01
    assert height(client, patched) < -1.0
    assert ground.rescues == 0


def test_a_body_that_is_nowhere_disturbs_no_other(client: Any) -> None:
    lost, fine = put(client, BALL, (0.013, 0.021, 0.5)), put(client, BALL, (0.013, 0.021, 0.3))
    client.resetBasePositionAndOrientation(lost, (math.nan, 0.0, 0.0), (0, 0, 0, 1))
    ground = Ground(client, level())
    for body in (lost, fine):
        ground.attach(body)
    for step in range(240):
        ground.step(step * DT, DT)
    assert height(client, fine) == pytest.approx(0.02, abs=1e-3)


def test_a_step_of_another_length_than_pybullets_is_refused(client: Any) -> None:
    ground = Ground(client, level())
    with pytest.raises(InputError, match=r"dt is 0\.01 s, but PyBullet steps 0\.0041\d* s; call setTimeStep\(0\.01\)"):
        ground.step(0.0, 0.01)
    client.setTimeStep(0.01)
    ground.step(0.0, 0.01)


SHAPES: tuple[Shape, ...] = (Sphere(0.15), Box(0.3, 0.2, 0.2), Cylinder(radius=0.1, height=0.3), Sphere(0.03))
STATES = st.tuples(
    st.sampled_from(SHAPES), st.floats(-0.2, 2.0), st.tuples(*[st.floats(-4.0, 4.0)] * 2, st.floats(-30.0, 2.0))
)


@given(bodies=st.lists(STATES, min_size=1, max_size=4), rise=st.floats(-1.0, 1.0), every=st.sampled_from([1, 4, 12]))
@settings(max_examples=12, deadline=None)
def test_trajectories_are_those_of_world(bodies: Any, rise: float, every: int) -> None:
    """The same bodies on the same moving ground: equal to the bit."""
    x = np.tile(np.linspace(-4.0, 4.0, 81), (81, 1))

    def heights(time: float) -> np.ndarray:
        return 0.1 * np.sin(2.0 * x) + rise * time

    def maps() -> HeightMap:
        return HeightMap(heights(0.0), resolution=0.1, origin=(-4.0, -4.0))

    physics = PhysicsConfig()
    states = [
        (shape, BodyState((-1.5 + index, 0.1 * index, z), linear=linear))
        for index, (shape, z, linear) in enumerate(bodies)
    ]
    bullet = BulletClient(pb.DIRECT)
    set_up(bullet, physics)
    factory, mine, ground = BodyFactory(bullet, physics), maps(), None
    ground = Ground(bullet, Terrain.of(mine))
    own = [factory.simulated(f"body {index}", shape, 1.0, state) for index, (shape, state) in enumerate(states)]
    for body, (shape, _) in zip(own, states, strict=True):
        ground.attach(body.uid, shape=shape)
    theirs, time = maps(), 0.0
    with World(theirs) as world:
        for index, (shape, state) in enumerate(states):
            world.spawn(f"body {index}", shape, 1.0, state)
        for step in range(120):
            if step % every == 0:
                for heightmap in (mine, theirs):
                    heightmap.replace(heights(time), time=time)
            assert time == world.time
            world.step()
            ground.step(time, physics.dt)
            time += physics.dt
            for body in own:
                expected = world.state(body.name)
                assert bullet.getBasePositionAndOrientation(body.uid) == (expected.position, expected.orientation)
                assert bullet.getBaseVelocity(body.uid) == (expected.linear, expected.angular)
        assert ground.rescues == world.rescues
    bullet.disconnect()
