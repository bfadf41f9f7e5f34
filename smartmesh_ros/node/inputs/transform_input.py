"""Transforms from ``/tf`` and ``/tf_static``, subscribed to on first use."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.cdr_reader import CdrReader, Stamped
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.node.inputs.optional_messages import require_message
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


class TransformInput:
    """The frame buffer and its subscriptions, which `listen` creates. ``listening``: True once they exist."""

    def __init__(self, session: Session) -> None:
        self.buffer = FrameBuffer()
        self._session = session
        self._own: set[str] = set()
        self._others: dict[str, float] = {}  # steady time of their last message [s]; infinite for static frames
        self._sent: deque[int] = deque(maxlen=MOST_OWN)
        self.listening = False

    def listen(self, what: str) -> None:
        """Subscribes, once. Raises `InputError` if the package that ``what`` needs is not installed."""
        if self.listening:
            return
        kind = require_message("tf2_msgs", "TFMessage", what)
        self.listening = True
        moving = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._session.listen(kind, "/tf", partial(self._take, static=False), moving, raw=True, private=False)
        self._session.listen(kind, "/tf_static", partial(self._take, static=True), latched, raw=True, private=False)

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
                time = None if static else self._time_of(start)
                back = self.buffer.add(start.frame_id, child, transform, time)
                if own:
                    self._own.add(child)
                else:
                    self._others[child] = max(now, self._others.get(child, now))
                if back:
                    words = f"transforms of {child!r} before this one were dropped: its stamp is {back:.3f} s older"
                    cause = "as if the clock of its source was set back or a recording started over"
                    raise InputError("stamp_backwards", f"{words}, {cause}")
            except InputError as error:
                self._session.refusals.add(topic, error)

    def _time_of(self, start: Stamped) -> float:
        """Return the stamp of a transform [s]; that of one without stamp is now."""
        if (seconds := stamp_seconds(start)) is not None:
            return seconds
        session = self._session
        session.unstamped["/tf"] += 1
        words = f"transforms of {start.name!r} on /tf have no stamp, and hold when they arrive"
        session.node.get_logger().warning(words, throttle_duration_sec=LOG_PERIOD)
        return session.clock_now()


# Takes the name of what follows a frame, the frame's pose, its stamp [s], None = static, and whether stamps start over.
Follow = Callable[[str, Transform, float | None, bool], None]


class FollowedFrames:
    """Calls ``follow`` with each new pose of ``frames`` (by the names of what follows them) in the terrain's frame, and
    with that of a static frame again and again. ``source``: of what is refused."""

    def __init__(
        self, session: Session, transforms: TransformInput, source: str, frames: Mapping[str, str], follow: Follow
    ) -> None:
        self._session, self._buffer, self._source = session, transforms.buffer, source
        self._frames, self._follow = frames, follow
        self._seen: dict[str, tuple[Transform, float]] = {}  # the last pose and stamp of each
        self._version, self._due = -1, 0.0  # of the buffer at the last look-up; when the next is due [s]
        if frames:
            transforms.listen(source)

    def refresh(self) -> None:
        """Look each frame up, if a transform arrived or a `PERIOD` has passed; failures count once a `PERIOD`."""
        session = self._session
        if not self._frames or not session.frame_id:
            return
        now = session.clock.pace()
        overdue = now >= self._due
        if self._buffer.version == self._version and not overdue:
            return
        self._version = self._buffer.version
        self._due = now + PERIOD if overdue else self._due
        for name, frame in self._frames.items():
            try:
                pose, stamp = self._buffer.lookup(session.frame_id, frame)
                seen = self._seen.get(name)
                if stamp is None:
                    self._follow(name, pose, None, False)
                elif (pose, stamp) != seen:
                    self._follow(name, pose, stamp, seen is not None and stamp < seen[1])
                    self._seen[name] = pose, stamp
            except InputError as error:
                if overdue:
                    session.refusals.add(self._source, error)

    def forget(self) -> None:
        """Look up at once, and accept any stamps, after a reset."""
        self._due = 0.0
        self._seen.clear()
