"""Friction of robots acts against their slip, at every heading alike, on whatever they touch. Robots that are not
attached have it along the world's axes alone: the wheel of the first test pulls 0.04 of its load on PyBullet's plane at
2 degrees, and 0.09 at 5."""

import math
from pathlib import Path

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Box, Carrier, Deck
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.world.joints import JointCommand
from tests import urdfs
from tests.bodies import about_z, ground_of, run
from tests.grounds import add, level, shaped, world_of
from tests.soil.test_soil_world import world_on

HEADINGS = (0.0, 2.0, 5.0, 20.0, 45.0, 70.0)  # [degrees]
FREE = '<limit lower="-9" upper="9" effort="1e5" velocity="9"/>'
# A wheel under a mast that a sled draws along a rail.
RIG = urdfs.robot(
    urdfs.link("rail", "", 1.0, 1.0), urdfs.link("sled", "", 1.0, 1.0), urdfs.link("mast", "", 8.0, 1.0),
    urdfs.link("wheel", '<cylinder radius="0.2" length="0.1"/>', 2.0, 0.03, rpy="1.5707963267948966 0 0"),
    urdfs.joint("draw", "prismatic", "rail", "sled", FREE, axis="1 0 0", xyz="0 0 0"),
    urdfs.joint("load", "prismatic", "sled", "mast", FREE, axis="0 0 1", xyz="0 0 0"),
    urdfs.joint("axle", "continuous", "mast", "wheel", xyz="0 0 0"),
)  # fmt: skip


@pytest.mark.parametrize("on_plane", [False, True])
@pytest.mark.parametrize("heading", HEADINGS)
def test_a_wheel_that_slips_pulls_by_its_friction(heading: float, on_plane: bool, tmp_path: Path) -> None:
    """On the ground, and on PyBullet's plane above it."""
    (tmp_path / "rig.urdf").write_text(RIG)
    client = BulletClient(pb.DIRECT)
    client.setGravity(0.0, 0.0, -9.81)
    turn = about_z(math.radians(heading))
    rig = client.loadURDF(str(tmp_path / "rig.urdf"), (0.0, 0.0, 0.2), turn, useFixedBase=True)
    client.changeDynamics(rig, 2, lateralFriction=0.5)
    client.setJointMotorControl2(rig, 0, pb.VELOCITY_CONTROL, targetVelocity=0.5, force=1e5)
    client.setJointMotorControl2(rig, 1, pb.VELOCITY_CONTROL, force=0.0)
    client.setJointMotorControl2(rig, 2, pb.VELOCITY_CONTROL, targetVelocity=0.5 / 0.2 / 0.7, force=1e5)
    if on_plane:
        plane = client.createMultiBody(0.0, client.createCollisionShape(pb.GEOM_PLANE))
        client.changeDynamics(plane, -1, lateralFriction=1.0)
    ground = ground_of(client, shaped(lambda x, y: -9.0 * on_plane, 101), rig)
    run(ground)
    total = np.zeros(3)
    for _ in range(24):
        run(ground, 1)
        for point in client.getContactPoints(rig):
            total += sum(np.multiply(size, point[at]) for size, at in ((point[9], 7), (point[10], 11), (point[12], 13)))
    ahead, aside, up = np.array(client.getMatrixFromQuaternion(turn)).reshape(3, 3).T @ total
    assert (ahead / up, aside / up) == pytest.approx((0.5, 0.0), abs=1e-3)


BLOCK = urdfs.robot(urdfs.link("block", urdfs.box((0.4, 0.4, 0.2)), 1.0, (0.4, 0.4, 0.2)))
FLOOR = urdfs.robot(urdfs.link("floor", urdfs.box((8.0, 8.0, 0.4)), 500.0, (8.0, 8.0, 0.4)))


@pytest.mark.parametrize(("sliding", "floor", "mu"), [
    (BLOCK, FLOOR, 0.25), (BLOCK, Box(8.0, 8.0, 0.4), 0.25), (Box(0.4, 0.4, 0.2), FLOOR, 0.25), (BLOCK, "", 0.5),
    (Box(0.4, 0.4, 0.2), "", 0.5),
])  # fmt: skip
@pytest.mark.parametrize("heading", HEADINGS)
def test_what_slides_on_a_robot_is_braked_against_its_slip(
    heading: float, sliding: Shape | str, floor: Shape | str, mu: float
) -> None:
    """Also robots on other bodies, and cargo on the deck of a robot (no ``floor``). PyBullet multiplies the frictions
    of two bodies, which are 0.5 here; that of a deck is 1."""
    turn = math.radians(heading)
    way, aside = np.array([math.cos(turn), math.sin(turn), 0.0]), np.array([-math.sin(turn), math.cos(turn), 0.0])
    with world_of(level(101), friction=0.5, sleep=False) as world:
        add(world, "floor", floor or FLOOR, BodyState((0.0, 0.0, 0.2)), 500.0)
        if not floor:
            world.terrain.put("deck", Deck(level(81), thickness=0.3))
            world.carry("deck", Carrier("floor", position=(0.0, 0.0, 0.25)))
        world.step(24)
        at = (0.0, 0.0, 0.5 if floor else 0.55)
        add(world, "sliding", sliding, BodyState(at, about_z(turn), tuple(2.0 * way)))
        world.step(4)
        before = np.array(world.state("sliding").linear)
        world.step(48)
        slows = (world.state("sliding").linear - before) / (48 / 240 * 9.81)
    assert (slows @ way, slows @ aside) == pytest.approx((-mu, 0.0), abs=3e-3 * mu)


RESISTS = '<contact><rolling_friction value="0.01"/></contact>'
PLACES = {
    "front_left": (0.3, 0.25),
    "front_right": (0.3, -0.25),
    "rear_left": (-0.3, 0.25),
    "rear_right": (-0.3, -0.25),
}
WHEEL = '<cylinder radius="0.15" length="0.08"/>'
CART = urdfs.robot(
    urdfs.link("body", urdfs.box((0.6, 0.3, 0.1)), 20.0, (0.6, 0.3, 0.1)),
    *(urdfs.link(f"{name}_wheel", WHEEL, 1.0, 0.01, RESISTS, rpy="1.5707963 0 0") for name in PLACES),
    *(urdfs.joint(at, "continuous", "body", f"{at}_wheel", xyz=f"{x} {y} -0.05") for at, (x, y) in PLACES.items()),
)  # fmt: skip


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_cart_that_rolls_freely_is_braked_by_its_friction_against_rolling(heading: float) -> None:
    """Whose torque on each wheel is 0.01 m times its load."""
    turn, radius = math.radians(heading), 0.15
    way, aside = np.array([math.cos(turn), math.sin(turn), 0.0]), np.array([-math.sin(turn), math.cos(turn), 0.0])
    with world_of(level(101), friction=1.0, sleep=False) as world:
        world.spawn_robot("cart", CART, BodyState((0.0, 0.0, 0.2), about_z(turn), tuple(way)), on_ground=True)
        cart = world.bodies["cart"]
        for joint in cart.joints.values():
            world.client.resetJointState(cart.uid, joint, 0.0, 1.0 / radius)
        world.step(24)
        before = np.array(world.state("cart").linear)
        world.step(240)
        slows = world.state("cart").linear - before
    law = 0.01 / radius * 24.0 * 9.81 / (24.0 + 4.0 * 0.01 / radius**2)
    assert (slows @ way, slows @ aside) == pytest.approx((-law, 0.0), abs=0.005 * law)


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_robot_on_soil_drives_straight_ahead(heading: float) -> None:
    """Within 0.5 % of its way."""
    turn = math.radians(heading)
    with world_on("dry_sand") as world:
        world.spawn_robot("husky", urdfs.HUSKY, BodyState((2.0, 2.0, 0.0), about_z(turn)), on_ground=True)
        wheels = [it.name for it in world.joints("husky") if "wheel" in it.name]
        places = []
        for step in range(600):
            for name in wheels:
                world.command("husky", name, JointCommand(velocity=3.0 * min(step / 240.0, 1.0)))
            world.step()
            places.append(world.base_state("husky").position)
    way = np.subtract(places[-1], places[240])
    ahead, aside = way[:2] @ [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    assert ahead > 0.7 and abs(aside) < 0.005 * ahead
