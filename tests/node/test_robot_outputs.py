"""What the node publishes of robots: of those of one link as of others, under names that stay."""

from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from simulation_interfaces.msg import Result
from simulation_interfaces.srv import GetEntityBounds, GetEntityInfo, GetEntityState
from smartmesh_msgs.msg import BodyDescriptionArray
from smartmesh_msgs.srv import RemoveBody

from smartmesh_ros.tools.testing import Probe, Process
from tests.node.shared import LATCHED, show_level_ground
from tests.node.shared import spawn as spawn_body

SHARED = {"simulation_interfaces": True, "frame_id": "map"}
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
    spawn_body(probe, name, (x, 2.0, 0.1), urdf=f'<robot name="r">{links}</robot>', **more)


@pytest.mark.parametrize("kinds", [*([kind] for kind in STIFF), list(STIFF)])
def test_robots_that_cannot_move_their_links_are_published(
    shared: Probe, shared_node: tuple[Probe, Process], kinds: list[str]
) -> None:
    show_level_ground(shared)
    described = shared.listen("body_descriptions", BodyDescriptionArray, LATCHED)
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


ARM = (
    f'<link name="base">{inertial(2.0)}{BOX}</link><link name="arm">{inertial(0.1)}</link>'
    '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0.1 0.2 0.3"/>'
    '<axis xyz="0 0 1"/><limit effort="5" velocity="50"/></joint>'
    f'<link name="slider">{inertial(0.1)}</link>'
    '<joint name="slide" type="prismatic"><parent link="arm"/><child link="slider"/><axis xyz="1 0 0"/>'
    '<limit lower="-1" upper="1" effort="5" velocity="50"/></joint>'
)
JOINTS = ["hinge", "slide"]


def names(probe: Probe) -> list[str]:
    return list(probe.latest("joint_states").name)


def roots(probe: Probe, count: int) -> set[str]:
    """Child frames of the odometry, once there are so many."""
    received = probe.received[probe.topic("odometry")]
    received.clear()
    probe.wait_for(lambda: len({message.child_frame_id for message in received}) == count)
    return {message.child_frame_id for message in received}


def test_names_stay_whatever_robots_come_and_go(shared: Probe) -> None:
    show_level_ground(shared)
    shared.listen("odometry", Odometry)
    spawn(shared, "one", ARM, 0.7)
    shared.wait_for(lambda: names(shared) == JOINTS)
    assert roots(shared, 1) == {"base"}
    spawn(shared, "two", ARM, 1.7)
    spawn(shared, "three", STIFF["one_link"], 2.5)
    prefixed = [f"two/{joint}" for joint in JOINTS]
    shared.wait_for(lambda: names(shared) == JOINTS + prefixed)
    assert roots(shared, 3) == {"base", "two/base", "three/base"}
    # What was published as a name is taken as one: it means the first robot, not whichever is alone.
    publisher = shared.publisher(JointState, "joint_commands")

    def turned() -> bool:
        publisher.publish(JointState(name=["hinge", "two/hinge"], position=[0.4, -0.4]))
        return np.allclose(np.array(shared.latest("joint_states").position)[[0, 2]], (0.4, -0.4), atol=0.02)

    shared.wait_for(turned)
    assert shared.call("remove_body", RemoveBody, id="one").success
    shared.wait_for(lambda: names(shared) == prefixed)
    assert roots(shared, 2) == {"two/base", "three/base"}
    spawn(shared, "four", ARM, 0.7)
    shared.wait_for(lambda: names(shared) == prefixed + JOINTS)


def test_every_robot_has_a_prefix_by_a_parameter(probe: Probe) -> None:
    with probe.running(parameters={"publish.robot_prefix": True}):
        show_level_ground(probe)
        spawn(probe, "one", ARM)
        probe.listen("odometry", Odometry)
        probe.wait_for(lambda: names(probe) == [f"one/{joint}" for joint in JOINTS])
        assert roots(probe, 1) == {"one/base"}
        publisher = probe.publisher(JointState, "joint_commands")

        def turned() -> bool:  # a robot that is alone takes both names in commands
            publisher.publish(JointState(name=["hinge", "one/slide"], position=[0.4, 0.1]))
            return np.allclose(probe.latest("joint_states").position, (0.4, 0.1), atol=0.02)

        probe.wait_for(turned)
