"""Bodies of other nodes on the same terrain, read from their ``~/body_states`` and simulated here as guests.

States are read directly from the message's bytes, because a Python object per body would cost more time than simulating
the body.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from smartmesh_msgs.msg import TrackedBodyArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, counted
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.inputs.conversions import require_distinct
from smartmesh_ros.node.inputs.source_clocks import SourceClocks
from smartmesh_ros.node.parameters.settings import AUTO, MOST_BODIES
from smartmesh_ros.node.session import Session, require_name
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.node.transport import STATES, colliders
from smartmesh_ros.world.state_table import StateTable

# Fields of a TrackedBody after its name; they start at the next multiple of eight bytes.
BODY_RECORD = np.dtype(
    {
        "names": ["numbers", "radius", "shape", "dimensions", "centre", "mass"],
        "formats": [("<f8", (13,)), "<f4", "u1", ("<f4", (3,)), ("<f4", (3,)), "<f4"],
        "offsets": [0, 104, 108, 112, 124, 136],
        "itemsize": 140,
    }
)
BODY_BYTES = BODY_RECORD.itemsize
# Minimum size of a TrackedBody [bytes]: length and closing zero of the name, and the fields after the name.
MIN_BODY_BYTES = 5 + BODY_BYTES
# Maximum time between a stamp and the instant its states hold for [s]; states are published in the step that made them.
MAX_AHEAD = 1.0
# Best effort and depth 1, because only the newest states are used.
NEWEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class PeerStates(NamedTuple):
    """Content of a TrackedBodyArray: stamp (``sec``, ``nanosec``), frame, ``ahead``: time from the stamp to the instant
    of the states [s], physics ``rate`` [Hz], ``gravity`` [m/s^2], and the bodies."""

    sec: int
    nanosec: int
    frame_id: str
    ahead: float
    rate: float
    gravity: Vector
    bodies: StateTable


class PeerReader:
    """Reads the messages of one node. Reuses the list of names while the names do not change."""

    def __init__(self) -> None:
        self._content = b""  # the names as in the message, each closed by a zero
        self._names: list[str] = []

    def read(self, data: bytes) -> PeerStates:
        """Return the content of a TrackedBodyArray's bytes. Raises `InputError` if the message is malformed, has too
        many bodies or too long a name, or two bodies of one name."""
        reader = CdrReader(data)
        if data[1] != 1:
            raise InputError("malformed", "big-endian body states; only little-endian ones are read")
        sec, nanosec, frame_id = reader.number("i"), reader.number("I"), reader.text()
        ahead, rate, *gravity = reader.numbers("f", 5)
        count = reader.count(MIN_BODY_BYTES)
        if count > MOST_BODIES:
            raise InputError("size", f"{count} bodies; at most {MOST_BODIES} are possible")
        if not np.isfinite([ahead, rate, *gravity]).all():
            raise InputError("non_finite", f"ahead, rate, gravity are {ahead}, {rate}, {gravity}; all must be finite")
        if abs(ahead) > MAX_AHEAD:
            words = f"ahead is {ahead} s; it must be at most {MAX_AHEAD:g} s before or after the stamp"
            raise InputError("stamp", words)
        rows = np.empty((count, BODY_BYTES), np.uint8)
        content = CORE.split_bodies(np.frombuffer(data, np.uint8)[4:], reader.at, rows)
        if content is None:
            raise InputError("malformed", f"the message ends after {len(data)} bytes; {count} bodies need more")
        if content != self._content or count != len(self._names):
            self._names, self._content = _names_in(content, count), content
        bodies = rows.view(BODY_RECORD)[:, 0]
        table = StateTable(
            self._names, np.ascontiguousarray(bodies["numbers"]), bodies["radius"].astype(np.float64),
            np.array(bodies["shape"]), bodies["dimensions"].astype(np.float64), bodies["centre"].astype(np.float64),
            bodies["mass"].astype(np.float64),
        )  # fmt: skip
        x, y, z = gravity
        return PeerStates(sec, nanosec, frame_id, ahead, rate, (x, y, z), table)


def _names_in(content: bytes, count: int) -> list[str]:
    try:
        names = content.decode().split("\0")[:-1]
    except UnicodeDecodeError:
        raise InputError("malformed", "a body's name is not UTF-8") from None
    if len(names) != count:  # C code would read a shorter name than this one
        raise InputError("empty_id", "a body's name has a zero byte in it")
    require_distinct(names)
    require_name(max(names, key=len, default=""))
    return names


# Period of the search for new peers [s].
DISCOVERY_PERIOD = 1.0
# Relative tolerance for equal gravity and rate, which messages hold in single precision.
RELATIVE_TOLERANCE = 1e-5


def topic_of(peer: str) -> str:
    """Return the topic of a node's body states."""
    return f"{peer}/{STATES}"


class _Peer:
    """Another node. ``heard``: time of its last accepted message, as of `Session.awake` [s], None = not heard.
    ``refused``: reason of its last refusal."""

    def __init__(self, subscription: Any) -> None:
        self.subscription = subscription
        self.reader = PeerReader()
        self.heard: float | None = None
        self.refused = ""


class PeerBodies:
    """Subscribes to the peers in ``bodies.peers``, or, with ``auto``, to all that it discovers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._own = session.node.get_fully_qualified_name()
        self._auto = AUTO in session.settings.peers
        self._named = [name for name in session.settings.peers if name not in (AUTO, self._own)]
        self._peers: dict[str, _Peer] = {}
        self._clocks = SourceClocks(session)
        self._due = 0.0
        for name in self._named:
            self._listen(name)

    def refresh(self) -> None:
        """Remove the bodies of peers that timed out, and search for new peers once per `DISCOVERY_PERIOD`."""
        now = self._session.awake()
        for name, peer in self._peers.items():
            if peer.heard is not None and now - peer.heard > self._session.settings.body_timeout:
                peer.heard = None
                self._clocks.pop(name, None)
                self._session.world.guests.forget(name)
                self._session.node.get_logger().warning(f"{name} is not heard any more; its bodies were removed here")
        if self._auto and (steady := self._session.clock.steady()) >= self._due:
            self._due = steady + DISCOVERY_PERIOD
            self._discover()

    def restart(self, time: float) -> None:
        """Go on at ``time`` [s] of a clock that was set: all heard peers count as heard now."""
        for peer in self._peers.values():
            peer.heard = None if peer.heard is None else time

    def summaries(self) -> dict[str, str]:
        """Return the diagnostics text of each peer by name."""
        counts = self._session.world.guests.counts
        found = {}
        for name, peer in self._peers.items():
            if name in counts:
                bodies, guests, late = counts[name]
                found[name] = f"{counted(bodies)}, {guests} of them guests, {1e3 * late:.1f} ms late"
            else:
                found[name] = peer.refused or "not heard"
        return found

    def silent(self) -> list[str]:
        """Return the peers named in ``bodies.peers`` that are not heard."""
        return [name for name in self._named if self._peers[name].heard is None]

    def _listen(self, name: str) -> None:
        session = self._session
        take = partial(self._on_states, name)
        subscription = session.listen(TrackedBodyArray, topic_of(name), take, NEWEST_QOS, raw=True, private=False)
        self._peers[name] = _Peer(subscription)

    def _discover(self) -> None:
        """Subscribe to new nodes, and unsubscribe from nodes that are gone."""
        node, own = self._session.node, self._session.topics.published
        found = [name for name in colliders(node) if topic_of(name) not in own]
        for name in found:
            if name not in self._peers:
                self._listen(name)
        for name in [name for name in self._peers.keys() - {*found} if self._peers[name].heard is None]:
            subscription = self._peers.pop(name).subscription
            self._session.subscriptions.remove(subscription)
            node.destroy_subscription(subscription)

    def _on_states(self, name: str, data: bytes) -> None:
        peer, session = self._peers[name], self._session
        try:
            with session.world.stopwatch.stage("ingest"):
                new = peer.reader.read(data)
                if not self._fits(name, new):
                    return
                stamp = stamp_seconds(new)
                if self._clocks.of(name).is_overtaken(stamp, session.clock_now(), math.inf):
                    raise InputError("overtaken", f"states of {name} arrived after newer ones")
                with self._clocks.placing(name, stamp) as placed:
                    objections = session.world.guests.take(name, new.bodies, placed.time + new.ahead)
        except InputError as error:
            peer.refused = f"refused: {error}"
            raise
        peer.heard, peer.refused = session.awake(), ""
        for objection in objections:
            session.refusals.add(topic_of(name), objection)

    def _fits(self, name: str, new: PeerStates) -> bool:
        """Return True if a peer has this node's terrain frame; False for a discovered node of another frame. Raises
        `InputError` if a named peer has another frame, or a peer another rate or gravity."""
        physics = self._session.settings.world.physics
        try:
            self._session.require_frame(new.frame_id)
        except InputError:
            if self._auto:
                return False
            raise
        if not math.isclose(new.rate, physics.rate, rel_tol=RELATIVE_TOLERANCE):
            raise InputError("rate", f"{name} steps at {new.rate:g} Hz, this node at {physics.rate:g} Hz; set one rate")
        if math.dist(new.gravity, physics.gravity) > RELATIVE_TOLERANCE * max(1.0, math.hypot(*physics.gravity)):
            theirs, ours = (", ".join(f"{value:g}" for value in values) for values in (new.gravity, physics.gravity))
            words = f"{name} has gravity ({theirs}) m/s^2, this node ({ours}) m/s^2; set one physics.gravity"
            raise InputError("gravity", words)
        return True
