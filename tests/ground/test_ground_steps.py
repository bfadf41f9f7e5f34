"""`Ground.step` in a PyBullet world of the user's own: as safe as `World`, by the same code."""

import math
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Ground, HeightMap, InputError, MotionConfig, Terrain, World
from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig, set_up
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.bodies import BodyFactory
from tests.bodies import height, put
from tests.core import mesh_parts
from tests.grounds import level
from tests.urdfs import HUSKY

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


def test_ground_of_a_mesh_above_a_body_counts_only_where_there_is_none_below_it(client: Any) -> None:
    floor, top = mesh_parts.sheet(4.0, 1), mesh_parts.box((-0.5, -0.5, 0.5), (0.5, 0.5, 0.6))
    ground = Ground(client, TriangleMesh(*mesh_parts.joined(floor, top)))
    body = put(client, Sphere(0.1), (0.0, 0.0, 9.0))
    ground.attach(body)

    def lift(x: float, z: float) -> float:
        client.resetBasePositionAndOrientation(body, (x, 0.2, z), (0.0, 0.0, 0.0, 1.0))
        ground.update(0.0, DT)
        return height(client, body) - z

    for z in (0.7, 0.55, 0.3):  # over the box, in it, and under it
        assert lift(0.1, z) == 0.0
    assert lift(0.1, -0.2) == pytest.approx(0.6 + 0.3)
    assert lift(1.0, -0.2) == pytest.approx(0.3)
    assert lift(3.0, -0.2) == 0.0
    assert ground.rescues == 2
    for nowhere in ((math.nan, -0.2), (math.inf, -0.2), (0.1, math.nan)):
        lift(*nowhere)
    assert ground.rescues == 2


FLAT = np.zeros((41, 41))


class Scene:
    """Bodies of every kind on ground that covers, corrects, carries and wakes them: rigid bodies, multibodies, a robot
    with joints, one that is fixed, and a body of another node's."""

    def __init__(self) -> None:
        self.client: Any = BulletClient(pb.DIRECT)
        set_up(self.client, PhysicsConfig())
        corrected = MotionConfig(changes="correction", settle=0.1)
        self.moving = HeightMap(FLAT, resolution=0.1, origin=(-5.0, -2.0))
        self.corrected = HeightMap(FLAT, resolution=0.1, origin=(1.0, -2.0), motion=corrected)
        self.terrain = Terrain(self.moving)
        self.terrain.put("corrected", self.corrected)
        self.ground = Ground(self.client, self.terrain)
        self.bodies = []
        for row, x in enumerate((-4.0, 2.0)):
            for column, shape in enumerate((Box(0.4, 0.3, 0.2), Cylinder(radius=0.1, height=0.2), Sphere(0.1))):
                place = (x + 0.013, column - 1.2, 0.1)
                self.bodies.append(put(self.client, shape, place, useMaximalCoordinates=(row + column) % 2))
            for base, fixed in ((0.3, False), (0.2, True)):
                at = (x + 1.0, -1.0 + 2.0 * fixed, base)
                self.bodies.append(self.client.loadURDF(HUSKY, at, useFixedBase=fixed))
        for body in self.bodies:
            self.ground.attach(body)
        self.ground.let_sleep(SleepConfig(after=0.2))

    def disturb(self, step: int, time: float) -> None:
        """Do what belongs before a step."""
        if step == 240:
            self.moving.replace(FLAT + 0.25, time=time + 100.0)  # long after: no velocity
        if step in (240, 480):
            self.corrected.replace(FLAT + 0.02 * step / 240, time=time)
        if step == 600:
            self.client.resetBaseVelocity(self.bodies[0], (0.0, 0.0, 1.0))
        if step == 660:
            self.terrain.remove("corrected")

    def state(self) -> list[Any]:
        """All that PyBullet tells of the bodies, and what the ground did."""
        client, found = self.client, []
        for body in self.bodies:
            joints = range(client.getNumJoints(body))
            links = client.getLinkStates(body, joints, 1) if joints else ()
            found.append((client.getBasePositionAndOrientation(body), client.getBaseVelocity(body), links))
        asleep = [self.ground.is_asleep(body) for body in self.bodies]
        return [*found, asleep, self.ground.rescues, self.ground.clock]


def test_a_users_own_steps_are_those_of_the_ground() -> None:
    """Equal to the bit: bodies that a map covers are lifted, corrections move others, and they sleep and wake."""
    mine, theirs = Scene(), Scene()
    slept, woke, time = set(), set(), 0.0
    for step in range(720):
        for scene in (mine, theirs):
            scene.disturb(step, time)
        mine.client.stepSimulation()
        theirs.ground.step(time, DT)
        time += DT
        found = mine.state()
        assert found == theirs.state(), step
        asleep = {number for number, sleeps in enumerate(found[-3]) if sleeps}
        woke |= slept - asleep
        slept |= asleep
    assert mine.ground.rescues >= 4 and len(slept) >= 6 and len(woke) >= 4
    for scene in (mine, theirs):
        scene.client.disconnect()


@pytest.mark.parametrize("ends", ["close", "resetSimulation"])
def test_a_new_ground_begins_at_time_zero(client: Any, ends: str) -> None:
    first = Ground(client, level())
    client.stepSimulation()
    assert first.clock > 0.0
    first.close() if ends == "close" else client.resetSimulation()
    assert Ground(client, level()).clock == 0.0
