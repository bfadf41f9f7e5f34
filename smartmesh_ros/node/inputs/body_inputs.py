"""Tracked bodies from topics and TF frames, and commands to robots' joints and bases."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import chain

from geometry_msgs.msg import PoseArray, PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError, listed, naming
from smartmesh_ros.ground.limits import SIZES, require_between, require_possible
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.conversions import BodyInput, joint_commands_from, tracked_joints_from
from smartmesh_ros.node.inputs.source_clocks import SourceClocks
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.parameters.entries import topic_name
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.node.session import Session, require_name
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.world.base import Base
from smartmesh_ros.world.tracked_robot import TrackedPart, TrackedRobot

SOURCE = "bodies.frames"
# Matches reliable and best-effort publishers alike.
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class BodyInputs:
    """Applies messages about bodies to the world, and moves bodies with TF frames. ``transforms``: of all frames."""

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self.transforms = session, transforms
        self._clocks = SourceClocks(session, lambda age: session.clock.pace() - age)
        self._pose_array_names: set[str] = set()
        self._gone: list[str] = []  # bodies that timed out, and are not logged yet
        self._told = -LOG_PERIOD  # steady time of that line [s]
        shapes = session.settings.shapes
        self._solids = {entry.body: entry.solid for entry in shapes if entry.solid is not None}
        with naming("bodies.shapes"):
            self._robots = {entry.body: TrackedRobot(entry.body, entry.urdf) for entry in shapes if entry.urdf}
        for name, frame in session.settings.frames:
            transforms.follow(SOURCE, frame, partial(self._follow, name, frame))
        session.listen(TrackedBodyArray, "tracked_bodies", self._on_bodies, BEST_EFFORT)
        session.listen(PoseArray, "body_poses", self._on_poses, BEST_EFFORT)
        session.listen(JointState, "joint_commands", self._on_joint_commands, BEST_EFFORT)
        if self._robots:
            session.listen(JointState, "tracked_joint_states", self._on_tracked_joints, BEST_EFFORT)
        for name, topic in session.settings.poses:
            with naming(f"bodies.poses, body {name!r}"):
                session.listen(PoseStamped, topic, partial(self._on_pose, name, topic), BEST_EFFORT, private=False)
        for name, topic in session.settings.odometry:
            with naming(f"bodies.odometry, body {name!r}"):
                session.listen(Odometry, topic, partial(self._on_odometry, name, topic), BEST_EFFORT, private=False)
        for entry in session.settings.bases:
            drive, name = partial(self._drive, session.bases[entry.body]), topic_name(entry.body)
            session.listen(Twist, f"cmd_vel/{name}", drive, BEST_EFFORT)
            session.listen(TwistStamped, f"cmd_vel_stamped/{name}", partial(self._on_stamped, drive), BEST_EFFORT)

    def expire(self) -> None:
        """Removes the tracked bodies without a pose for the time-out, and logs them, at most once a `LOG_PERIOD`."""
        session, gone = self._session, self._gone
        gone += session.tracking.expire(session.awake())
        if gone and session.clock.steady() - self._told >= LOG_PERIOD:
            names = listed([*map(repr, gone)])
            words = f"no pose came within bodies.timeout = {session.settings.body_timeout:g} s: removed {names}"
            session.node.get_logger().info(words)
            self._gone, self._told = [], session.clock.steady()

    def _on_bodies(self, message: TrackedBodyArray) -> None:
        self._track("tracked_bodies", message.header, conversions.bodies_from(message))

    def _on_poses(self, message: PoseArray) -> None:
        bodies = conversions.poses_from(message)
        self._track("body_poses", message.header, bodies)
        names = {body.name for body in bodies}
        for name in self._pose_array_names - names:
            self._session.tracking.forget(name)
        self._pose_array_names = names

    def _on_pose(self, name: str, topic: str, message: PoseStamped) -> None:
        self._track(topic, message.header, [BodyInput(name, conversions.state_from(message.pose), 0.0)])

    def _on_odometry(self, name: str, topic: str, message: Odometry) -> None:
        self._track(topic, message.header, [BodyInput(name, conversions.odometry_from(message), 0.0, stated=True)])

    def _track(self, topic: str, header: Header, bodies: list[BodyInput]) -> None:
        session = self._session
        stamp = stamp_seconds(header.stamp)
        transform = self.transforms.to_terrain(header.frame_id, stamp)
        with self._clocks.placing(topic, stamp) as placed:
            if transform is not None:
                bodies = [body._replace(state=transform.apply(body.state)) for body in bodies]
            for body in bodies:
                session.require_not_simulated(body.name)
                require_name(body.name)
                require_between(f"radius of {body.name!r}", self._radius(body), SIZES, "m")
            self._set(topic, bodies, placed.time)

    def _follow(self, name: str, frame: str, pose: Transform, stamp: float | None, restarted: bool) -> None:
        session, source = self._session, f"{SOURCE} {name}"
        session.require_not_simulated(name)
        if self.transforms.is_own(frame):
            words = f"frame {frame!r} of body {name!r} is one that this node publishes (publish.tf)"
            raise InputError("own_topic", f"{words}; a body that follows it would overlap the simulated one")
        if restarted:
            self._clocks.pop(source, None)
        with self._clocks.placing(source, stamp) as placed:
            self._set(SOURCE, [BodyInput(name, BodyState(*pose), 0.0)], placed.time)

    def _set(self, topic: str, bodies: list[BodyInput], time: float) -> None:
        """Set the states of bodies, and of all parts of robots, at ``time`` [s] of the loop's clock; count and log
        jumps of their poses."""
        session, parts = self._session, [self._parts(body) for body in bodies]
        session.require_room(part.name for part in chain.from_iterable(parts))
        for part in chain.from_iterable(parts):
            require_possible(part.name, part.state)
        for body, own in zip(bodies, parts, strict=True):
            jumps = [session.tracking.update(*part, time, session.awake(), stated=body.stated) for part in own]
            if jump := next(filter(None, jumps), ""):
                session.counts[f"jumps on {topic}"] += 1
                session.node.get_logger().warning(f"{topic}: {jump}", throttle_duration_sec=LOG_PERIOD)

    def _radius(self, body: BodyInput) -> float:
        return body.radius or self._session.settings.default_radius

    def _parts(self, body: BodyInput) -> list[TrackedPart]:
        """Return the tracked bodies that a body is: itself, or the parts of its robot. Without a stated velocity theirs
        is zero, to be estimated from successive poses."""
        robot = self._robots.get(body.name)
        if robot is None:
            solid = body.solid or self._solids.get(body.name) or Sphere(self._radius(body))
            return [TrackedPart(body.name, solid, body.state)]
        parts = [*robot.parts(body.state)]
        if body.stated or any(body.state.linear) or any(body.state.angular):
            return parts
        return [part._replace(state=BodyState(part.state.position, part.state.orientation)) for part in parts]

    def _on_joint_commands(self, message: JointState) -> None:
        world, names = self._session.world, self._session.robot_names
        lasts = self._session.settings.command_timeout or math.inf
        for robot, joint, command in joint_commands_from(message, world, names.prefixes()):
            world.command(robot, joint, command, lasts)

    def _on_tracked_joints(self, message: JointState) -> None:
        """Moves the joints of tracked robots, which take their places with the next pose of the root link."""
        known = {name: robot.joints for name, robot in self._robots.items()}
        moved = tracked_joints_from(message, known)
        for name, joints in moved.items():
            self._robots[name].require(joints)
        for name, joints in moved.items():
            self._robots[name].move(joints)

    def _drive(self, base: Base, twist: Twist) -> None:
        base.drive(twist.linear.x, twist.angular.z, self._session.settings.command_timeout or math.inf)

    def _on_stamped(self, drive: Callable[[Twist], None], message: TwistStamped) -> None:
        """Drive by a command, unless its stamp says that its time is over: it was held up, or is of another clock."""
        session, stamp = self._session, stamp_seconds(message.header.stamp)
        age, timeout = 0.0 if stamp is None else session.clock_now() - stamp, session.settings.command_timeout
        if timeout and age > timeout:
            raise InputError("stamp", f"the command is {age:.3f} s old; bodies.command_timeout is {timeout:g} s")
        drive(message.twist)
