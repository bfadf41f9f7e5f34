"""What moves a sleeping body moves it as one that never slept, in the step in which it comes: among many others that
sleep, in a PyBullet world of the user's own."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Box, Ground, HeightMap
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import ground_of, height, put
from tests.core import mesh_parts
from tests.grounds import level
from tests.urdfs import box, joint, link, robot

DT = 1.0 / 240.0
SIDE = 0.2  # half the edge of a box [m]
SETTLED, STEPS = 240, 240


class Yard:
    """A box at the origin, others far away, and whatever a case puts beside them."""

    def __init__(self, maximal: bool, sleeps: bool, terrain: HeightMap | TriangleMesh, others: int) -> None:
        self.maximal, self.terrain, self.other = maximal, terrain, -1  # what a case puts beside the box
        self.client: Any = BulletClient(pb.DIRECT)
        self.client.setGravity(0.0, 0.0, -9.81)
        self.ground = Ground(self.client, terrain)
        self.box = self.add((0.0, 0.0, SIDE))
        for k in range(others):
            self.add((-8.0 + 0.6 * k, 5.0, SIDE))
        self.ground.let_sleep(SleepConfig() if sleeps else None)

    def add(self, place: tuple[float, float, float], mass: float = 2.0, attached: bool = True) -> int:
        body = put(self.client, Box(*(2.0 * SIDE,) * 3), place, mass, useMaximalCoordinates=self.maximal)
        if attached:
            self.ground.attach(body)
        return body

    def move(self, body: int, place: tuple[float, ...], turn: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)) -> None:
        self.client.resetBasePositionAndOrientation(body, place, turn)

    def push(self, force: tuple[float, float, float], torque: tuple[float, float, float]) -> None:
        self.client.applyExternalForce(self.box, -1, force, (0.0, 0.0, 0.0), pb.LINK_FRAME)
        self.client.applyExternalTorque(self.box, -1, torque, pb.WORLD_FRAME)

    def run(self, first: int, count: int, act: Callable[[int], object] = lambda _: None) -> np.ndarray:
        """Poses of the box after each step."""
        places = []
        for step in range(first, first + count):
            act(step - first)
            self.ground.step(step * DT, DT)
            places.append(np.concatenate(self.client.getBasePositionAndOrientation(self.box)))
        return np.array(places)


Act = Callable[[Yard, int], object]


def table(yard: Yard) -> None:
    """The box stands on a table of the user's own."""
    yard.other = put(yard.client, Box(2.0, 2.0, 0.5), (0.0, 0.0, 0.25), 0.0)
    yard.move(yard.box, (0.0, 0.0, 0.5 + SIDE))


def stacked(yard: Yard) -> None:
    """The box stands on another one."""
    yard.other = yard.add((0.0, 0.0, SIDE))
    yard.move(yard.box, (0.0, 0.0, 3.0 * SIDE))


def tied(yard: Yard) -> None:
    """A rod ties the box to another one."""
    yard.other = yard.add((1.0, 0.0, SIDE))
    pivots = (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
    yard.client.createConstraint(yard.box, -1, yard.other, -1, pb.JOINT_POINT2POINT, (0, 0, 0), *pivots)


def alone(yard: Yard) -> None:
    """A body of the user's own stands beside the box."""
    yard.other = yard.add((-0.6, 0.0, SIDE), 0.0, attached=False)


def moved(place: tuple[float, float, float], velocity: tuple[float, float, float], *, goes: bool = True) -> Act:
    """The user moves the other body himself in each step, from a place on [m], at a velocity [m/s]; a belt that has a
    velocity, and is held where it is, does not go."""

    def act(yard: Yard, step: int) -> None:
        yard.move(yard.other, tuple(np.add(place, np.multiply(velocity, goes * step * DT))))
        yard.client.resetBaseVelocity(yard.other, velocity)

    return act


def at_first(act: Callable[[Yard], object]) -> Act:
    """Something that is done before the first step."""
    return lambda yard, step: act(yard) if step == 0 else None


CASES: dict[str, tuple[Callable[[Yard], None], Act]] = {
    "a tied body is driven": (tied, lambda yard, _: yard.client.resetBaseVelocity(yard.other, (0.5, 0.0, 0.0))),
    "the box below is detached": (stacked, at_first(lambda yard: yard.ground.detach(yard.other))),
    "the box below is removed": (stacked, at_first(lambda yard: yard.client.removeBody(yard.other))),
    "its table is removed": (table, at_first(lambda yard: yard.client.removeBody(yard.other))),
    "its table is a lift": (table, moved((0.0, 0.0, 0.25), (0.0, 0.0, 0.2))),
    "its table is a conveyor": (table, moved((0.0, 0.0, 0.25), (0.3, 0.0, 0.0), goes=False)),
    "a pusher comes": (alone, moved((-0.6, 0.0, SIDE), (0.5, 0.0, 0.0))),
    "a body falls on it": (alone, at_first(lambda yard: yard.add((0.1, 0.0, 1.5), 5.0, attached=False))),
    "its velocity is set": (alone, at_first(lambda yard: yard.client.resetBaseVelocity(yard.box, (1.0, 0.0, 1.0)))),
    "it is turned": (alone, at_first(lambda yard: yard.move(yard.box, (0.0, 0.0, SIDE), (0.0, 0.0, 0.1, 0.995)))),
    "it is lifted": (alone, at_first(lambda yard: yard.move(yard.box, (0.0, 0.0, 1.0)))),
    "it is pushed": (alone, lambda yard, _: yard.push((15.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
    "it is spun": (alone, lambda yard, _: yard.push((0.0, 0.0, 0.0), (0.0, 0.0, 5.0))),
    "its ground falls": (alone, at_first(lambda yard: yard.terrain.replace(yard.terrain.heights - 0.5, time=1000.0))),
}


@pytest.mark.parametrize("maximal", [True, False], ids=["rigid body", "multibody"])
@pytest.mark.parametrize("name", CASES)
def test_a_sleeping_body_moves_as_if_it_were_awake(name: str, maximal: bool) -> None:
    build, act = CASES[name]
    paths = []
    for sleeps in (True, False):
        yard = Yard(maximal, sleeps, level(201), others=20)
        build(yard)
        start = yard.run(0, SETTLED)[-1]
        held = name == "a tied body is driven" and not maximal  # by a pivot that may be moved at any time
        assert yard.ground.is_asleep(yard.box) == (sleeps and not held)
        paths.append(yard.run(SETTLED, STEPS, lambda step: act(yard, step)))  # noqa: B023
        yard.client.disconnect()
    asleep, awake = paths
    assert np.abs(awake - start).max() > 0.01 or "falls on it" in name, "it does move"
    lawful = [0, 2] if "tied" in name else range(7)  # a box that is pulled along drifts aside, by no law
    np.testing.assert_allclose(asleep[:, lawful], awake[:, lawful], rtol=0.0, atol=5e-3)


@pytest.mark.parametrize("maximal", [True, False], ids=["rigid body", "multibody"])
@pytest.mark.parametrize(
    ("made", "drop", "every"),
    [
        (lambda: level(201), 0.002, 1), (lambda: level(201), 1.0, 4),
        (lambda: TriangleMesh(*mesh_parts.sheet(20.0, 40)), 0.05, 1),
    ],
    ids=["little", "seldom", "mesh"],
)  # fmt: skip
def test_a_body_that_pybullet_put_to_sleep_falls_with_its_ground(
    made: Any, drop: float, every: int, maximal: bool
) -> None:
    """Whichever step the map comes in; it may fall asleep between two updates."""
    yard = Yard(maximal, sleeps=False, terrain=made(), others=0)
    yard.client.changeDynamics(yard.box, -1, activationState=pb.ACTIVATION_STATE_ENABLE_SLEEPING)

    def run(steps: int) -> float:
        for step in range(steps):
            if step % every == 0:
                yard.ground.update(yard.ground.clock, DT)
            yard.client.stepSimulation()
        return height(yard.client, yard.box)

    before = run(60)
    while any(map(any, yard.client.getBaseVelocity(yard.box))):
        before = run(60)
        assert yard.ground.clock < 25.0, "it does not fall asleep"
    if isinstance(yard.terrain, HeightMap):
        yard.terrain.replace(yard.terrain.heights - drop, time=1000.0)
    else:
        yard.terrain.move(yard.terrain.vertices - (0.0, 0.0, drop), time=1000.0)
    assert run(240) == pytest.approx(before - drop, abs=5e-4)
    yard.client.disconnect()


def test_a_motor_that_is_told_something_else_through_pybullet_wakes_its_robot(client: Any, tmp_path: Path) -> None:
    edges = (0.4, 0.2, 0.2)
    parts = (link("base", box(edges), 1.0, edges), link("arm", box(edges), 0.3, edges))
    (tmp_path / "arm.urdf").write_text(robot(*parts, joint("turn", "continuous", "base", "arm", axis="0 0 1")))
    arm = client.loadURDF(str(tmp_path / "arm.urdf"), (0.0, 0.0, 0.1))
    ground = ground_of(client, level(), arm)
    ground.let_sleep(SleepConfig(after=0.1))
    for target in (0.0, 0.5):
        for _ in range(240):
            client.setJointMotorControl2(arm, 0, pb.POSITION_CONTROL, targetPosition=target, force=5.0)
            ground.step(ground.clock, DT)
        assert client.getJointState(arm, 0)[0] == pytest.approx(target, abs=0.02)
        assert ground.is_asleep(arm)
