"""What the node publishes of robots: of those of one link as of others, under names that stay."""

from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from simulation_interfaces.msg import Result
from simulation_interfaces.srv import GetEntityBounds, GetEntityInfo, GetEntityState
from smartmesh_msgs.msg import BodyDescriptionArray, ContactWrenchArray
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.testing import Probe, Process, pose_message
from tests.node.shared import show_level_ground

SHARED = {"simulation_interfaces": True, "frame_id": "map"}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BOX = '<collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision>'
LIDAR = '<link name="lidar"/><joint name="j" type="fixed"><parent link="base"/><child link="lidar"/></joint>'


def inertial(mass: float) -> str:
    return (
        f'<inertial><mass value="{mass}"/>'
        f'<inertia ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


STIFF = {
    "one_link": f'<link name="base">{inertial(2.0)}{BOX}</link>',
    "fixed_links": f'<link name="base">{inertial(2.0)}{BOX}</link>{LIDAR}',
    "without_inertial": f'<link name="base">{BOX}</link>',
    "without_mass": f'<link name="base">{inertial(0.0)}{BOX}</link>',
    "held": f'<link name="world"/><link name="base">{inertial(2.0)}{BOX}</link>'
    '<joint name="j" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 1"/></joint>',
}


def spawn(probe: Probe, name: str, links: str, x: float = 2.0, **more: Any) -> None:
    answer = probe.call(
        "spawn_body", SpawnBody, id=name, urdf=f'<robot name="r">{links}</robot>', pose=pose_message((x, 2.0, 0.1)),
        **more,
    )  # fmt: skip
    assert answer.success, answer.message


@pytest.mark.parametrize("kinds", [*([kind] for kind in STIFF), list(STIFF)])
def test_robots_that_cannot_move_their_links_are_published(
    shared: Probe, shared_node: tuple[Probe, Process], kinds: list[str]
) -> None:
    show_level_ground(shared)
    described = shared.listen("body_descriptions", BodyDescriptionArray, LATCHED)
    for kind, topic in ((JointState, "joint_states"), (Odometry, "odometry"), (ContactWrenchArray, "contact_wrenches")):
        shared.listen(topic, kind)
    for place, kind in enumerate(kinds):
        spawn(shared, kind, STIFF[kind], 0.5 + place)
    assert shared_node[1].process.poll() is None
    shared.wait_for(lambda: {body.id for body in shared.latest("body_states").bodies} == set(kinds))
    shared.wait_for(lambda: described and {body.id for body in described[-1].bodies} == set(kinds))
    message = shared.latest("joint_states")
    assert (list(message.name), list(message.position)) == ([], [])
    shared.latest("odometry")
    places = {wrench.body_id: wrench.centre.z for wrench in shared.latest("contact_wrenches").wrenches}
    assert set(places) == {f"{kind}/base" for kind in kinds}
    assert np.isfinite(list(places.values())).all()
    for kind in kinds:
        for service, request in (
            ("get_entity_state", GetEntityState),
            ("get_entity_info", GetEntityInfo),
            ("get_entity_bounds", GetEntityBounds),
        ):
            assert shared.call(service, request, entity=kind).result.result == Result.RESULT_OK
    for topic in ("patches", "collider_patches", "contacts"):
        shared.latest(topic)
