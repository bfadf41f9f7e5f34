"""Friction of robots acts against their slip, at every heading alike. On PyBullet's own plane it does so along the
world's axes alone: the wheel of the first test pulls 0.04 of its load there at 2 degrees, and 0.09 at 5."""

import math
from pathlib import Path

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState
from smartmesh_ros.world.joints import JointCommand
from tests import urdfs
from tests.bodies import about_z, ground_of, run
from tests.grounds import level
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


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_wheel_that_slips_pulls_by_its_friction(heading: float, tmp_path: Path) -> None:
    (tmp_path / "rig.urdf").write_text(RIG)
    client = BulletClient(pb.DIRECT)
    client.setGravity(0.0, 0.0, -9.81)
    turn = about_z(math.radians(heading))
    rig = client.loadURDF(str(tmp_path / "rig.urdf"), (0.0, 0.0, 0.2), turn, useFixedBase=True)
    client.changeDynamics(rig, 2, lateralFriction=0.5)
    client.setJointMotorControl2(rig, 0, pb.VELOCITY_CONTROL, targetVelocity=0.5, force=1e5)
    client.setJointMotorControl2(rig, 1, pb.VELOCITY_CONTROL, force=0.0)
    client.setJointMotorControl2(rig, 2, pb.VELOCITY_CONTROL, targetVelocity=0.5 / 0.2 / 0.7, force=1e5)
    ground = ground_of(client, level(101), rig)
    run(ground)
    total = np.zeros(3)
    for _ in range(24):
        run(ground, 1)
        for point in client.getContactPoints(rig):
            total += sum(np.multiply(size, point[at]) for size, at in ((point[9], 7), (point[10], 11), (point[12], 13)))
    ahead, aside, up = np.array(client.getMatrixFromQuaternion(turn)).reshape(3, 3).T @ total
    assert (ahead / up, aside / up) == pytest.approx((0.5, 0.0), abs=1e-3)


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
