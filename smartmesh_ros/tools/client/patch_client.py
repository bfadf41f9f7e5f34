"""A client that keeps the newest patch of each body, for a simulator's loop."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from threading import Lock
from time import monotonic

import rclpy
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import try_shutdown
from smartmesh_msgs.msg import ColliderPatchArray, TrackedBody, TrackedBodyArray

from smartmesh_ros.errors import InputError, require, require_body_name
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.outputs.cdr import xyz
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.node.transport import colliders
from smartmesh_ros.tools.client.patch import Patch, read_patches
from smartmesh_ros.tools.messages import DEPTH

# Reliable and deep, because an incremental message must not be lost.
QOS = QoSProfile(depth=DEPTH)


@dataclass(frozen=True, kw_only=True)
class TrackedLink:
    """A link that gets a patch, in the terrain's frame: ``position`` of its centre [m], ``radius`` of its bounding
    sphere [m], ``orientation`` (x, y, z, w), ``linear`` [m/s] and ``angular`` [rad/s] velocity. If all velocities of
    a link have been zero so far, the node estimates them from successive poses."""

    name: str
    position: Vector
    radius: float
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)


class PatchClient:
    """Keeps the newest patch of each body of a ``terrain_collider``, and publishes the poses of the simulator's links.

    ``collider``: full name of the node terrain_collider. ``node``: the caller's node, spun by the caller's executor;
    None = the client creates a node and context of its own and spins them in `spin_once`. ``ahead`` [s]: maximum time
    by which patches are extrapolated, so that the ground stops if terrain_collider is gone. A context manager.

    All methods except `spin_once` and `close` are thread-safe.
    """

    def __init__(self, collider: str = "/terrain_collider", *, node: Node | None = None, ahead: float = 0.25) -> None:
        require(0.0 <= ahead < math.inf, "parameter", "ahead", ahead, "a number of seconds from zero on")
        self.ahead = ahead
        self.received = 0  # number of messages accepted
        self.refused = 0  # number of malformed messages
        self._executor: EventsExecutor | None = None
        if node is None:
            context = Context()
            rclpy.init(context=context)
            node = Node("patch_client", context=context)
            self._executor = EventsExecutor(context=context)
            self._executor.add_node(node)
        self.node = node
        self._lock = Lock()
        self._known: dict[str, Patch] = {}
        self._stamp: float | None = None  # of the last message; None until a message with all patches arrived
        self.frame_id = ""  # of the terrain; empty before the first message
        self._publisher = node.create_publisher(TrackedBodyArray, f"{collider}/tracked_bodies", QOS)
        self._subscription = node.create_subscription(
            ColliderPatchArray, f"{collider}/collider_patches", self._on_bytes, QOS, raw=True
        )

    def __enter__(self) -> PatchClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the client, and its node if the client created it."""
        if self._executor is None:
            self.node.destroy_subscription(self._subscription)
            self.node.destroy_publisher(self._publisher)
            return
        self._executor.shutdown()
        self.node.destroy_node()
        try_shutdown(context=self.node.context)

    def spin_once(self, timeout: float = 0.0) -> bool:
        """Wait up to ``timeout`` [s] for a message and handle all that arrived. Return True if any arrived. Raises
        `RuntimeError` if the caller passed a node."""
        if self._executor is None:
            raise RuntimeError("the client's node is the caller's: spin it with the caller's executor")
        before = seen = self.received + self.refused
        self._executor.spin_once(timeout_sec=timeout)
        while (now := self.received + self.refused) > seen:
            seen = now
            self._executor.spin_once(timeout_sec=0.0)
        return seen > before

    def wait_for(self, names: Iterable[str], timeout: float = 30.0) -> dict[str, Patch]:
        """Spin until each of ``names`` has a patch; return all patches. Raises `TimeoutError`."""
        wanted, end = set(names), monotonic() + timeout
        while not wanted <= self.patches().keys():
            if monotonic() > end:
                words = f"no patch of {sorted(wanted - self.patches().keys())} after {timeout:g} s"
                if not self.connected:
                    there = ", ".join(colliders(self.node)) or "none"
                    words += f"; nobody publishes {self._subscription.topic_name}; running nodes: {there}"
                raise TimeoutError(words)
            self.spin_once(0.02)
        return self.patches()

    def now(self) -> float:
        """Return the time of the node's ROS clock [s]: simulated time if the node's ``use_sim_time`` is set."""
        return float(self.node.get_clock().now().nanoseconds * 1e-9)

    def patches(self, now: float | None = None) -> dict[str, Patch]:
        """Return the patches by body name, extrapolated to ``now`` [s] (None = the clock's time)."""
        return self._extrapolated(now)

    def patch(self, name: str, now: float | None = None) -> Patch | None:
        """Return the patch of a body, extrapolated to ``now`` [s] (None = the clock's time); None if it has none."""
        return self._extrapolated(now, name).get(name)

    def age(self, now: float | None = None) -> float:
        """Return the time since the stamp of the last message [s]; infinite before the first."""
        with self._lock:
            stamp = self._stamp
        return math.inf if stamp is None else (self.now() if now is None else now) - stamp

    @property
    def connected(self) -> bool:
        """True if the tracked bodies have a subscriber and the patches a publisher."""
        patches = self._subscription.topic_name
        return bool(self._publisher.get_subscription_count() and self.node.count_publishers(patches))

    def track(self, links: Iterable[TrackedLink], stamp: float | None = None) -> None:
        """Publish the states of links at ``stamp`` [s] (None = the clock's time). Each link gets a patch, and loses it
        if it is left out for longer than the node's ``bodies.timeout``. Raises `InputError` for an impossible name."""
        message = TrackedBodyArray(bodies=[_body(link) for link in links])
        message.header.frame_id = self.frame_id
        message.header.stamp = self.node.get_clock().now().to_msg() if stamp is None else stamp_of(stamp)
        self._publisher.publish(message)

    def _extrapolated(self, now: float | None, only: str | None = None) -> dict[str, Patch]:
        """Return the patches, or ``only`` one, extrapolated by their age. The stamp is the last message's, also for a
        patch that an incremental message left out, because such a patch is unchanged."""
        with self._lock:
            known, stamp = dict(self._known), self._stamp
        if stamp is None:
            return {}
        age = (self.now() if now is None else now) - stamp
        time = min(max(age, -self.ahead), self.ahead)
        names = known.keys() & {only} if only is not None else known
        return {name: known[name].after(time, stamp=stamp, age=age) for name in names}

    def _on_bytes(self, data: bytes) -> None:
        try:
            message = read_patches(data)
        except InputError:
            self.refused += 1
            return
        with self._lock:
            # An increment without a base is skipped; a message with all patches follows within seconds.
            if not message.incremental or self._stamp is not None:
                self._known = message.onto(self._known)
                self._stamp, self.frame_id = message.stamp, message.frame_id
        self.received += 1


def _body(link: TrackedLink) -> TrackedBody:
    require_body_name(link.name)
    pose = Pose(position=xyz(Point, link.position), orientation=xyz(Quaternion, link.orientation))
    twist = Twist(linear=xyz(Vector3, link.linear), angular=xyz(Vector3, link.angular))
    return TrackedBody(id=link.name, pose=pose, twist=twist, radius=float(link.radius))
