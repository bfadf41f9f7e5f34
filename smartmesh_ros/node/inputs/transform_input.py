"""Transforms from ``/tf`` and ``/tf_static``, subscribed to on first use, and what follows their frames."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.cdr_reader import CdrReader, Stamped
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.node.inputs.optional_messages import class_of
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.node.session import Session, require_name
from smartmesh_ros.node.timing.stamps import stamp_seconds


def transforms_from(data: bytes) -> Iterator[tuple[Stamped, Transform]]:
    """Yield the header and child of each transform of a TFMessage's bytes, and its pose, four times as fast as with
    rclpy's objects."""
    reader = CdrReader(data)
    for _ in range(reader.number("I")):
        start = reader.stamped()
        x, y, z, qx, qy, qz, qw = reader.numbers("d", 7)
        yield start, Transform((x, y, z), (qx, qy, qz, qw))


# Own messages to recognise when they return [-]: those of a second at any rate.
MOST_OWN = 1000
# Time after which a moving frame that another node published is nobody's [s]; longer than a localisation's period.
OTHERS_TIME = 5.0
# Longest time between two look-ups of the frames that are followed without a new transform [s], for static frames.
PERIOD = 0.2


# Takes a frame's pose, its stamp [s], None = static, and whether stamps start over.
Take = Callable[[Transform, float | None, bool], None]


@dataclass
class _Followed:
    """A frame that ``take`` follows. ``source``: of what is refused. ``seen``: the last pose and its stamp [s]."""

    source: str
    frame: str
    take: Take
    seen: tuple[Transform, float] | None = None


class TransformInput:
    """The frame buffer and its subscriptions, which `listen` creates, and what follows frames. ``listening``: True once
    the subscriptions exist."""

    def __init__(self, session: Session) -> None:
        self.buffer = FrameBuffer()
        self._session = session
        self._own: set[str] = set()
        self._others: dict[str, float] = {}  # steady time of their last message [s]; infinite for static frames
        self._sent: deque[int] = deque(maxlen=MOST_OWN)
        self._followed: list[_Followed] = []
        self._version, self._due = -1, 0.0  # of the buffer at the last look-up; when the next is due [s]
        self.listening = False

    def listen(self, what: str) -> None:
        """Subscribes, once. Raises `InputError` if the package that ``what`` needs is not installed."""
        if self.listening:
            return
        kind = class_of("tf2_msgs/msg/TFMessage", what)
        self.listening = True
        moving = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._session.listen(kind, "/tf", partial(self._take, static=False), moving, raw=True, private=False)
        self._session.listen(kind, "/tf_static", partial(self._take, static=True), latched, raw=True, private=False)

    def follow(self, source: str, frame: str, take: Take) -> None:
        """Calls ``take`` with each new pose of a frame in the terrain's frame, with that of a static one again and
        again. ``source``: of what is refused."""
        self.listen(source)
        self._followed.append(_Followed(source, frame, take))

    def refresh(self) -> None:
        """Look up the frames that are followed, if a transform arrived or a `PERIOD` has passed; failures count once a
        `PERIOD`."""
        session = self._session
        if not self._followed or not session.frame_id:
            return
        now = session.clock.pace()
        overdue = now >= self._due
        if self.buffer.version == self._version and not overdue:
            return
        self._version = self.buffer.version
        self._due = now + PERIOD if overdue else self._due
        for one in self._followed:
            try:
                pose, stamp = self.buffer.lookup(session.frame_id, one.frame)
                if stamp is None:
                    one.take(pose, None, False)
                elif (pose, stamp) != one.seen:
                    one.take(pose, stamp, one.seen is not None and stamp < one.seen[1])
                    one.seen = pose, stamp
            except InputError as error:
                if overdue:
                    session.refusals.add(one.source, error)

    def forget_stamps(self) -> None:
        """Drop all moving transforms, look up at once, and accept any stamps."""
        self.buffer.clear()
        self._due = 0.0
        for one in self._followed:
            one.seen = None

    def note_own(self, data: bytes) -> None:
        """Notes a message that this node is about to publish on ``/tf``: rclpy does not tell who sent a message."""
        self._sent.append(hash(data))

    def is_others(self, frame: str) -> bool:
        """Return True if another node publishes a frame."""
        return self._session.clock.steady() - self._others.get(frame, -math.inf) < OTHERS_TIME

    def is_own(self, frame: str) -> bool:
        """Return True if this node, and no other, publishes a frame."""
        return frame in self._own and not self.is_others(frame)

    def to_terrain(self, frame_id: str, stamp: float | None) -> Transform | None:
        """Return the transform from ``frame_id`` to the terrain's frame, None if equal. Raises `InputError`."""
        require_name(frame_id)
        terrain, frame_id = self._session.frame_id, frame_id.strip("/")
        if not terrain or not frame_id or frame_id == terrain:
            return None
        try:
            self.listen(f"a pose in frame {frame_id!r} instead of the terrain's, {terrain!r},")
        except InputError as error:
            raise InputError("frame", str(error)) from None
        return self.buffer.lookup(terrain, frame_id, stamp)[0]

    def _take(self, data: bytes, *, static: bool) -> None:
        """Add each transform on its own, so that a refused one does not affect the others."""
        topic = "/tf_static" if static else "/tf"
        own, now = hash(data) in self._sent, math.inf if static else self._session.clock.steady()
        for start, transform in transforms_from(data):
            child = start.name.strip("/")
            try:
                require_name(child)
                time = None if static else self._time_of(start, own=own)
                back = self.buffer.add(start.frame_id, child, transform, time)
                if own:
                    self._own.add(child)
                else:
                    self._others[child] = max(now, self._others.get(child, now))
                if back and not own:  # else this node's clock was set back
                    words = f"transforms of {child!r} before this one were dropped: its stamp is {back:.3f} s older"
                    cause = "as if the clock of its source was set back or a recording started over"
                    raise InputError("stamp_backwards", f"{words}, {cause}")
            except InputError as error:
                self._session.refusals.add(topic, error)

    def _time_of(self, start: Stamped, *, own: bool) -> float:
        """Return the stamp of a transform [s]; that of one without stamp is now, but that of this node is its time
        zero."""
        if (seconds := stamp_seconds(start)) is not None or own:
            return seconds or 0.0
        session = self._session
        session.counts["without stamp on /tf"] += 1
        words = f"transforms of {start.name!r} on /tf have no stamp, and hold when they arrive"
        session.node.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)
        return session.clock_now()
