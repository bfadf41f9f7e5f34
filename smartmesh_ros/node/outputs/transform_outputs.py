"""``/tf``: frames that this node sends, those of the bodies that it simulates above all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.transform import IDENTITY, Transform
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.cdr import ArrayMessage, fields_of, stamp_fields
from smartmesh_ros.node.outputs.rates import Rhythm
from smartmesh_ros.node.session import Session

TOPIC, PARAMETER = "/tf", "publish.tf"
# Time after subscribing in which frames of other nodes may not have arrived [s]; nothing is published before.
LISTENING_TIME = 1.0
_FIELDS = (*fields_of("transform.translation"), *fields_of("transform.rotation", "xyzw"))


class OwnFrame(NamedTuple):
    """A frame and its pose in the frame ``parent``."""

    parent: str
    child: str
    pose: Transform


class Broadcast:
    """Publishes frames, and notes that they are this node's own. Raises `InputError` if the package of TFMessage is not
    installed, which ``what`` needs."""

    def __init__(self, session: Session, transforms: TransformInput, what: str) -> None:
        self._session, self._transforms = session, transforms
        self._kind = class_of("tf2_msgs/msg/TFMessage", what)
        self._publisher = session.node.create_publisher(self._kind, TOPIC, 100)
        self._message = ArrayMessage()
        self._stamp = (0, 0)

    def close(self) -> None:
        self._session.node.destroy_publisher(self._publisher)

    def is_next(self, header: Header) -> bool:
        """Return True if a header has another stamp than that of the last call: listeners warn of a frame that comes
        twice at one time."""
        before, self._stamp = self._stamp, (header.stamp.sec, header.stamp.nanosec)
        return self._stamp != before

    def send(self, header: Header, frames: list[OwnFrame]) -> None:
        """Publish frames with the stamp of a header."""
        message = self._message
        message.start("frames", self._kind)
        numbers = np.array([(*frame.pose.translation, *frame.pose.rotation) for frame in frames])
        message.add_named(
            lambda parent, child: TransformStamped(header=Header(frame_id=parent), child_frame_id=child),
            {
                "header.frame_id": [frame.parent for frame in frames],
                "child_frame_id": [frame.child for frame in frames],
            },
            dict(zip(_FIELDS, numbers.T, strict=True)) | stamp_fields(header),
        )
        data = message.finish()
        self._transforms.note_own(data)
        self._publisher.publish(data)


class TransformOutputs:
    """Publishes the frames of simulated bodies and of the links of robots at the rate ``publish.tf``.

    A frame that another node publishes is left to that node, because a frame has one parent. So are the terrain's frame
    and those above it.
    """

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self._transforms = session, transforms
        self._broadcast: Broadcast | None = None
        self._left_out: set[str] = set()
        self._rhythm, self._listened = Rhythm(), 0.0
        self._odom_frames = {entry.body: entry.odom_frame for entry in session.settings.bases if entry.publish_tf}

    def publish(self, now: float, time: float, *, at_once: bool) -> None:
        """Publish the frames if they are due at the ``time`` by which rates count [s], or ``at_once``. ``now``: steady
        time [s]."""
        session, rate = self._session, self._session.settings.publish.tf
        if not rate:
            if self._broadcast is not None:
                self._broadcast.close()
            self._broadcast = None
            return
        if self._broadcast is None:
            self._broadcast = Broadcast(session, self._transforms, PARAMETER)
            self._transforms.listen(PARAMETER)
            self._listened = now + LISTENING_TIME
        if now < self._listened or not session.frame_id or not self._rhythm.is_due(time, rate, now=at_once):
            return
        header = Header(stamp=session.stamp_now(), frame_id=session.frame_id)
        if not self._broadcast.is_next(header):  # the clock stands still
            return
        with session.world.stopwatch.stage("publish"):
            if frames := self._own_frames(header.frame_id):
                self._broadcast.send(header, frames)

    def _own_frames(self, terrain: str) -> list[OwnFrame]:
        """Return the frames to publish, each child once."""
        taken = {terrain}
        with suppress(InputError):  # a cycle of other nodes' frames
            taken.update(self._transforms.buffer.way(terrain))
        left_out, frames = set(), []
        for frame in self._frames(terrain):
            if frame.child in taken or self._transforms.is_others(frame.child):
                left_out.add(frame.child)
            elif frame.child:
                taken.add(frame.child)
                frames.append(frame)
        if new := sorted(left_out - self._left_out):
            self._left_out |= left_out
            self._session.node.get_logger().info(
                f"{PARAMETER} leaves out frames that others have, or that are above the terrain's: {', '.join(new)}"
            )
        return frames

    def _frames(self, terrain: str) -> Iterator[OwnFrame]:
        """Yield the frames of all simulated bodies: a body's, at its centre of mass, has its name; a robot's links have
        theirs, and the robot's name is a second name of its root link. A base with ``publish_tf`` has its odometry's
        frame in place of its root link's."""
        world = self._session.world
        prefixes = self._session.robot_names.prefixes()
        for name, body in world.bodies.items():
            if not body.simulated:
                continue
            pose = Transform.of(world.base_state(name))
            if body.frames is None:
                yield OwnFrame(terrain, name, pose)
                continue
            links = body.frames.read()
            names = [(prefixes[name] + link.name).strip("/") for link in links]
            if (odom := self._odom_frames.get(name)) is None:
                yield OwnFrame(terrain, names[0], pose)
            else:  # its odometry publishes the root link's; REP 105
                yield OwnFrame(terrain, odom, pose.then(self._session.bases[name].odometry.pose.inverse()))
            for link, child in zip(links[1:], names[1:], strict=True):
                yield OwnFrame(names[link.parent], child, link.pose)
            if name not in names:
                yield OwnFrame(names[0], name, IDENTITY)
