"""The newest patch of each body, for a simulator's loop."""

from __future__ import annotations

import math
from collections.abc import Iterable
from threading import Lock
from time import monotonic
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from smartmesh_msgs.msg import ColliderPatchArray, TrackedBodyArray

from smartmesh_ros.client.messages import PatchesMessage, read_patches
from smartmesh_ros.client.patch import Patch
from smartmesh_ros.client.tracked import TrackedLink, tracked_bodies
from smartmesh_ros.errors import InputError

# Reliable: of increments none may be missing.
QOS = QoSProfile(depth=10)


class PatchClient:
    """Keeps the newest patch of each body of a ``terrain_collider`` and tells it where the simulator's links are.

    ``collider``: the node's whole name. ``node``: one of the caller's, spun by the caller's executor; None = a node of
    the client's own, with a context of its own, handled in `spin_once`. ``ahead`` [s]: patches are moved on by no more
    than this, so that ground whose node is gone does not run away. A context manager.

    All methods but `spin_once` and `close` may be called from any thread.
    """

    def __init__(self, collider: str = "/terrain_collider", *, node: Node | None = None, ahead: float = 0.25) -> None:
        if not (math.isfinite(ahead) and ahead >= 0.0):
            raise InputError("parameter", f"ahead is {ahead} s; it must be zero or more")
        self.ahead = ahead
        self.received = 0  # messages taken
        self.refused = 0  # messages that were malformed
        self._context: Context | None = None
        self._executor: SingleThreadedExecutor | None = None
        if node is None:
            self._context = Context()
            rclpy.init(context=self._context)
            node = Node("patch_client", context=self._context)
            self._executor = SingleThreadedExecutor(context=self._context)
            self._executor.add_node(node)
        self.node = node
        self._lock = Lock()
        self._known: dict[str, Patch] = {}
        self._stamp: float | None = None  # of the last message; None until one told of all patches
        self._frame_id = ""
        self._publisher = node.create_publisher(TrackedBodyArray, f"{collider}/tracked_bodies", QOS)
        self._subscription = node.create_subscription(
            ColliderPatchArray, f"{collider}/collider_patches", self._on_bytes, QOS, raw=True
        )

    def __enter__(self) -> PatchClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the client, and its node if that is its own."""
        if self._executor is None:
            self.node.destroy_subscription(self._subscription)
            self.node.destroy_publisher(self._publisher)
            return
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def spin_once(self, timeout: float = 0.0) -> bool:
        """Wait up to ``timeout`` [s] for a message, takes all that have arrived, and tells whether there were any. Not
        for a client on a node of the caller's."""
        if self._executor is None:
            raise RuntimeError("the client's node is the caller's: spin it with the caller's executor")
        before = seen = self.received + self.refused
        self._executor.spin_once(timeout_sec=timeout)
        while (now := self.received + self.refused) > seen:
            seen = now
            self._executor.spin_once(timeout_sec=0.0)
        return seen > before

    def wait_for(self, names: Iterable[str], timeout: float = 30.0) -> dict[str, Patch]:
        """Spin until each of ``names`` has a patch, and returns the patches; raises `TimeoutError`."""
        wanted, end = set(names), monotonic() + timeout
        while not wanted <= self.patches().keys():
            if monotonic() > end:
                raise TimeoutError(f"no patch of {sorted(wanted - self.patches().keys())} after {timeout:g} s")
            self.spin_once(0.02)
        return self.patches()

    def now(self) -> float:
        """Return the time of the node's ROS clock [s]: simulated time where the node's ``use_sim_time`` is set."""
        return float(self.node.get_clock().now().nanoseconds * 1e-9)

    def patches(self, now: float | None = None) -> dict[str, Patch]:
        """Return the patch of each body by its name, moved on to ``now`` [s] (None = the clock's time)."""
        with self._lock:
            known, stamp = dict(self._known), self._stamp
        if stamp is None:
            return {}
        age = (self.now() if now is None else now) - stamp
        return {name: self._aged(patch, stamp, age) for name, patch in known.items()}

    def patch(self, name: str, now: float | None = None) -> Patch | None:
        """Return the patch of one body, moved on to ``now`` [s] (None = the clock's time); None = it has none."""
        with self._lock:
            found, stamp = self._known.get(name), self._stamp
        if found is None or stamp is None:
            return None
        return self._aged(found, stamp, (self.now() if now is None else now) - stamp)

    def age(self, now: float | None = None) -> float:
        """Time since the stamp of the last message [s]; infinite before the first."""
        with self._lock:
            stamp = self._stamp
        return math.inf if stamp is None else (self.now() if now is None else now) - stamp

    @property
    def frame_id(self) -> str:
        """The terrain's frame, empty before the first message."""
        return self._frame_id

    @property
    def connected(self) -> bool:
        """Whether somebody listens to the tracked bodies and somebody publishes patches."""
        patches = self._subscription.topic_name
        return bool(self._publisher.get_subscription_count() and self.node.count_publishers(patches))

    def track(self, links: Iterable[TrackedLink], stamp: float | None = None) -> None:
        """Publish where links are at ``stamp`` [s] (None = the clock's time): each gets a patch. Links left out for
        the node's ``bodies.timeout`` lose theirs."""
        clock = self.node.get_clock()
        time: Any = clock.now() if stamp is None else Time(nanoseconds=round(stamp * 1e9), clock_type=clock.clock_type)
        self._publisher.publish(tracked_bodies(links, self._frame_id, time.to_msg()))

    def _aged(self, patch: Patch, stamp: float, age: float) -> Patch:
        """Return a kept patch at its age: one that a message with increments left out holds for that message's stamp."""
        return patch.after(min(max(age, -self.ahead), self.ahead)).aged(stamp, age)

    def _on_bytes(self, data: bytes) -> None:
        try:
            message = read_patches(data)
        except InputError:
            self.refused += 1
            return
        with self._lock:
            self._take(message)
        self.received += 1

    def _take(self, message: PatchesMessage) -> None:
        if message.incremental and self._stamp is None:
            return  # increments of what was never seen; all patches come within seconds
        if not message.incremental:
            self._known = {}
        for name in message.removed:
            self._known.pop(name, None)
        self._known.update((patch.name, patch) for patch in message.patches)
        self._stamp, self._frame_id = message.stamp, message.frame_id
