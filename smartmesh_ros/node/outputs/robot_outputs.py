"""Messages about robots: joint states, odometry and contact wrenches."""

from __future__ import annotations

from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import ContactWrench, ContactWrenchArray
from std_msgs.msg import Header

from smartmesh_ros.ground.quaternions import conjugate, rotate
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.world.world import World


def joint_states(header: Header, world: World, prefixes: dict[str, str]) -> JointState:
    """Return the states of all joints of the robots in ``prefixes``, which maps robots to the prefixes of their
    names."""
    found = [(prefix + joint.name, joint) for robot, prefix in prefixes.items() for joint in world.joints(robot)]
    return JointState(
        header=Header(stamp=header.stamp),  # joints have no frame
        name=[name for name, _ in found],
        position=[joint.position for _, joint in found],
        velocity=[joint.velocity for _, joint in found],
        effort=[joint.effort for _, joint in found],
    )


def odometry(header: Header, world: World, robot: str, prefix: str) -> Odometry:
    """Return the true pose of a robot's root link in the terrain's frame, and its twist in the frame of that link,
    ``<prefix><link>``."""
    state = world.base_state(robot)
    back = conjugate(state.orientation)
    root = world.client.getBodyInfo(world.bodies[robot].uid)[0].decode()
    message = Odometry(header=header, child_frame_id=prefix + root)
    message.pose.pose = pose_message(state)
    message.twist.twist = Twist(
        linear=_vector(rotate(back, state.linear)), angular=_vector(rotate(back, state.angular))
    )
    return message


def contact_wrenches(header: Header, world: World) -> ContactWrenchArray:
    """Return the wrench of the ground on every simulated body and link."""
    wrenches = []
    for found in world.wrenches():
        x, y, z = found.centre.tolist()
        wrench = Wrench(force=_vector(found.force.tolist()), torque=_vector(found.torque.tolist()))
        wrenches.append(ContactWrench(body_id=found.body, centre=Point(x=x, y=y, z=z), wrench=wrench))
    return ContactWrenchArray(header=header, wrenches=wrenches)


def pose_message(state: BodyState) -> Pose:
    """Return the pose of a state."""
    x, y, z = state.position
    qx, qy, qz, qw = state.orientation
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def twist_message(state: BodyState) -> Twist:
    """Return the twist of a state, in the terrain's frame."""
    return Twist(linear=_vector(state.linear), angular=_vector(state.angular))


def _vector(values: tuple[float, float, float] | list[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=float(x), y=float(y), z=float(z))
