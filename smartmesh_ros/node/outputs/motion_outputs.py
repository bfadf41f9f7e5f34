"""Outputs of what a robot measures of its own motion: IMUs, and the odometry of bases."""

from __future__ import annotations

import array
from typing import Any

from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu as ImuMessage
from std_msgs.msg import Header

from smartmesh_ros.ground.body_shapes import link_name
from smartmesh_ros.ground.quaternions import quaternion_of
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.body_outputs import pose_message
from smartmesh_ros.node.outputs.cdr import xyz
from smartmesh_ros.node.outputs.rates import Beat
from smartmesh_ros.node.outputs.transform_outputs import Broadcast, OwnFrame
from smartmesh_ros.node.parameters.entries import OutputEntry
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.terrain.deck import Frame
from smartmesh_ros.world.imu import Imu


class ImuOutput:
    """``~/imu/<body>/<link>``: an IMU of an entry of ``imus``, which measures while it has subscribers and its link is
    there. ``publisher``: of the readings."""

    def __init__(self, session: Session, entry: OutputEntry) -> None:
        self._session, self._entry = session, entry
        self.publisher = session.publisher(ImuMessage, entry.topic)
        self._imu: Imu | None = None

    def publish(self, *, now: bool) -> None:
        """Publish the readings since the last call, each with the stamp of its own step."""
        if not self.publisher.get_subscription_count():
            if self._imu is not None:
                self._imu.close()
                self._imu = None
            return
        if self._imu is None:
            self._imu = Imu(self._session.world, self._entry.body, self._entry.link, self._entry.config)
        session, entry, config = self._session, self._entry, self._entry.config
        for reading in self._imu.take():
            age = session.world.time - reading.time
            stamp = stamp_of((stamp_seconds(session.stamp_now()) or 0.0) - age)
            message = ImuMessage(header=Header(stamp=stamp, frame_id=frame_of(session, entry.body, entry.link)))
            message.orientation = xyz(Quaternion, reading.orientation)
            message.angular_velocity = xyz(Vector3, reading.angular_velocity)
            message.linear_acceleration = xyz(Vector3, reading.acceleration)
            message.angular_velocity_covariance = _diagonal(config.gyroscope_noise_density**2 / reading.duration)
            message.linear_acceleration_covariance = _diagonal(config.accelerometer_noise_density**2 / reading.duration)
            self.publisher.publish(message)


class OdometryOutput:
    """``~/odom/<body>``: the odometry of a base at its rate in simulated time, and with ``publish_tf`` the transform
    from its frame to the root link. ``publisher``: of the odometry."""

    def __init__(self, session: Session, entry: OutputEntry, transforms: TransformInput) -> None:
        self._session, self._entry, self._base = session, entry, session.bases[entry.body]
        self.publisher = session.publisher(Odometry, entry.topic)
        self._broadcast = Broadcast(session, transforms, "publish_tf of bases") if entry.publish_tf else None
        self._beat = Beat(session.world, entry.rate)

    def publish(self, *, now: bool) -> None:
        session, entry = self._session, self._entry
        body = session.world.bodies.get(entry.body)
        if body is None or not body.is_robot or not body.simulated:
            return
        if not self._beat.is_due(now=now):
            return
        header = Header(stamp=session.stamp_now(), frame_id=entry.odom_frame)
        pose, child = self._base.odometry.pose, frame_of(session, entry.body)
        if self.publisher.get_subscription_count():
            found, message = self._base.odometry, Odometry(header=header, child_frame_id=child)
            message.pose.pose, twist = pose_message(BodyState(*pose)), message.twist.twist
            twist.linear.x, twist.linear.y, twist.angular.z = found.linear, found.side, found.angular
            self.publisher.publish(message)
        if self._broadcast is not None and self._broadcast.is_next(header):
            self._broadcast.send(header, [OwnFrame(header.frame_id, child, pose)])


def deck_state(frame: Frame) -> BodyState:
    vectors = (vector.tolist() for vector in (frame.position, frame.velocity, frame.spin))
    position, linear, angular = ((x, y, z) for x, y, z in vectors)
    return BodyState(position, quaternion_of(frame.rotation), linear, angular)


def frame_of(session: Session, body: str, link: str = "") -> str:
    """Return the frame of a body, of a robot's link ("" = the root link), as on ``/tf``."""
    world, prefix = session.world, session.robot_names.prefixes().get(body)
    if prefix is None:
        return body
    return prefix + (link or link_name(world.client, world.bodies[body].uid, -1))


def _diagonal(variance: float) -> Any:
    return array.array("d", [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance])
