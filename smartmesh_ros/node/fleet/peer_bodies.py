"""Bodies of other nodes on the same terrain, taken from their ``~/body_states`` as guests of this one's world."""

from __future__ import annotations

import math
from functools import partial
from time import monotonic
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import TrackedBodyArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.fleet.peer_names import AUTO, TOPIC, topic_of
from smartmesh_ros.node.fleet.peer_states import PeerReader, PeerStates
from smartmesh_ros.node.inputs.conversions import stamp_seconds
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.pacing import StampClock

# Only the newest states count.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# How often peers are looked for [s].
LOOKING = 1.0
# A loop that took longer for a step has stood still [s].
STALL = 0.1
# Single precision keeps gravity and rate to this share.
SAME = 1e-5
KIND = "smartmesh_msgs/msg/TrackedBodyArray"


class _Peer:
    """One other node: what reads and dates its messages, and when one was taken last on the loop's clock [s]."""

    def __init__(self, subscription: Any) -> None:
        self.subscription = subscription
        self.reader = PeerReader()
        self.clock = StampClock()
        self.heard: float | None = None
        self.refused = ""


class PeerBodies:
    """Listens to the peers that ``bodies.peers`` names, or to all there are."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._own = session.node.get_fully_qualified_name()
        self._auto = AUTO in session.settings.peers
        self._named = [name for name in session.settings.peers if name not in (AUTO, self._own)]
        self._peers: dict[str, _Peer] = {}
        self._due = 0.0
        self._refreshed = math.inf
        if session.settings.peers:
            PeerReader().read(_nobody(), 0, 0)  # compiled before the first message comes
        for name in self._named:
            self._listen(name)

    def refresh(self) -> None:
        """Take away the guests of peers that are not heard any more, and looks for new ones now and then."""
        now = self._session.clock.pace()
        # While this node itself stood still nobody could be heard.
        pause, self._refreshed = max(now - self._refreshed - STALL, 0.0), now
        for name, peer in self._peers.items():
            if peer.heard is not None and pause:
                peer.heard += pause
            if peer.heard is not None and now - peer.heard > self._session.settings.body_timeout:
                peer.heard, peer.clock = None, StampClock()
                self._session.world.guests.forget(name)
                self._session.node.get_logger().warning(f"{name} is not heard any more; its bodies are gone from here")
        if self._auto and monotonic() >= self._due:
            self._due = monotonic() + LOOKING
            self._look()

    def forget_stamps(self) -> None:
        """Accept whatever stamps come next, after a reset."""
        for peer in self._peers.values():
            peer.clock = StampClock()

    def summaries(self) -> dict[str, str]:
        """What there is to say of each peer, by its name."""
        counts = self._session.world.guests.counts
        found = {}
        for name, peer in self._peers.items():
            if name in counts:
                bodies, guests, late = counts[name]
                found[name] = f"{bodies} bodies, {guests} of them guests, {1e3 * late:.1f} ms late"
            else:
                found[name] = peer.refused or "not heard"
        return found

    def silent(self) -> list[str]:
        """Peer that are named and not heard."""
        return [name for name in self._named if self._peers[name].heard is None]

    def _listen(self, name: str) -> None:
        session = self._session
        session.listen(
            TrackedBodyArray, topic_of(name), partial(self._on_states, name), NEWEST, raw=True, private=False
        )
        self._peers[name] = _Peer(session.subscriptions[-1])

    def _look(self) -> None:
        """Listen to nodes that are new, and no longer to those that are gone."""
        node = self._session.node
        found = {
            topic.removesuffix(f"/{TOPIC}")
            for topic, kinds in node.get_topic_names_and_types()
            if topic.endswith(f"/{TOPIC}")
            and KIND in kinds
            and node.count_publishers(topic)
            and topic not in self._session.topics.published
        }
        for name in sorted(found - self._peers.keys()):
            self._listen(name)
        for name in [name for name in self._peers.keys() - found if self._peers[name].heard is None]:
            subscription = self._peers.pop(name).subscription
            self._session.subscriptions.remove(subscription)
            node.destroy_subscription(subscription)

    def _on_states(self, name: str, data: bytes) -> None:
        peer, session = self._peers[name], self._session
        try:
            settings = session.settings
            with session.world.stopwatch.stage("ingest"):
                new = peer.reader.read(data, settings.most_bodies, settings.longest_name)
                if not self._fits(name, new):
                    return
                stamp = stamp_seconds(new)
                if peer.clock.is_late(stamp, math.inf):  # overtaken by the one before
                    return
                time = peer.clock.place(stamp, session.clock_now(), session.time_at)
                objections = self._session.world.guests.take(name, new.bodies, time + new.ahead)
                peer.clock.accept(stamp, time)
        except InputError as error:
            peer.refused = f"refused: {error}"
            raise
        peer.heard, peer.refused = session.clock.pace(), ""
        for objection in objections:
            session.refusals.add(topic_of(name), objection)

    def _fits(self, name: str, new: PeerStates) -> bool:
        """Whether a peer is on the same terrain and simulates as this node does; raises `InputError` if it is to be a
        peer and does not."""
        physics = self._session.settings.world.physics
        try:
            self._session.require_frame(new.frame_id)
        except InputError:
            if self._auto:
                return False
            raise
        if not math.isclose(new.rate, physics.rate, rel_tol=SAME):
            raise InputError("rate", f"{name} steps at {new.rate:g} Hz, this node at {physics.rate:g} Hz; set one rate")
        if math.dist(new.gravity, physics.gravity) > SAME * max(1.0, math.hypot(*physics.gravity)):
            theirs, ours = (", ".join(f"{value:g}" for value in values) for values in (new.gravity, physics.gravity))
            raise InputError(
                "gravity", f"{name} has gravity ({theirs}) m/s^2, this node ({ours}) m/s^2; set one physics.gravity"
            )
        return True


def _nobody() -> bytes:
    """Return a message without bodies."""
    return bytes(serialize_message(TrackedBodyArray()))
