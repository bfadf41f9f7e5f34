"""``/tf``: frames of the bodies that this node simulates."""

from __future__ import annotations

from collections.abc import Iterator

from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.transform import IDENTITY, Transform
from smartmesh_ros.node.inputs.optional_messages import require_message
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.broadcast import Broadcast, OwnFrame
from smartmesh_ros.node.outputs.motion_outputs import odometry_pose
from smartmesh_ros.node.outputs.rhythm import Rhythm
from smartmesh_ros.node.session import Session
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import LinkFrames

PARAMETER = "publish.tf"
# Time after subscribing in which frames of other nodes may not have arrived [s]; nothing is published before.
LISTENING_TIME = 1.0


class TransformOutputs:
    """Publishes the frames of simulated bodies and of the links of robots at the rate ``publish.tf``.

    A frame that another node publishes is left to that node, because a frame has one parent. So are the terrain's frame
    and those above it.
    """

    def __init__(self, session: Session, transforms: TransformInput) -> None:
        self._session, self._transforms = session, transforms
        self._broadcast: Broadcast | None = None
        self._robots: dict[str, tuple[Body, LinkFrames]] = {}
        self._left_out: set[str] = set()
        self._rhythm, self._listened = Rhythm(), 0.0
        self._odom_frames = {entry.body: entry.odom_frame for entry in session.settings.bases if entry.publish_tf}
        require_transforms(session.settings.publish.tf)

    def publish(self, now: float, time: float, *, at_once: bool) -> None:
        """Publish the frames if they are due at the ``time`` by which rates count [s], or ``at_once``. ``now``: steady
        time [s]."""
        session, rate = self._session, self._session.settings.publish.tf
        if not rate:
            self._close()
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

    def _close(self) -> None:
        if self._broadcast is not None:
            self._broadcast.close()
            self._broadcast = None

    def _own_frames(self, terrain: str) -> list[OwnFrame]:
        """Return the frames to publish, each child once."""
        taken = {terrain, *self._above(terrain)}
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

    def _above(self, terrain: str) -> list[str]:
        try:
            return self._transforms.buffer.ancestors(terrain)
        except InputError:  # a cycle of other nodes' frames
            return []

    def _frames(self, terrain: str) -> Iterator[OwnFrame]:
        """Yield the frames of all simulated bodies: a body's, at its centre of mass, has its name; a robot's links have
        theirs, and the robot's name is a second name of its root link. A base with ``publish_tf`` has its odometry's
        frame in place of its root link's."""
        world = self._session.world
        prefixes = self._session.robot_names.prefixes()
        self._robots = {name: known for name, known in self._robots.items() if world.bodies.get(name) is known[0]}
        for name, body in world.bodies.items():
            if not body.simulated:
                continue
            pose = Transform.of(world.base_state(name))
            if not body.is_robot:
                yield OwnFrame(terrain, name, pose)
                continue
            if name not in self._robots:
                self._robots[name] = body, LinkFrames(world.client, body.uid)
            links = self._robots[name][1].read()
            names = [(prefixes[name] + link.name).strip("/") for link in links]
            if (odom := self._odom_frames.get(name)) is None:
                yield OwnFrame(terrain, names[0], pose)
            else:  # its odometry publishes the root link's; REP 105
                yield OwnFrame(terrain, odom, pose.then(odometry_pose(self._session.bases[name]).inverse()))
            for link, child in zip(links[1:], names[1:], strict=True):
                yield OwnFrame(names[link.parent], child, link.pose)
            if name not in names:
                yield OwnFrame(names[0], name, IDENTITY)


def require_transforms(rate: float) -> None:
    """Raises `InputError` if a rate of ``publish.tf`` [Hz] needs the class TFMessage and its package is missing."""
    if rate:
        require_message("tf2_msgs", "TFMessage", PARAMETER)
