"""The clocks of a node: one paces its loop, one stamps its messages."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node

from smartmesh_ros.errors import InputError


class NodeClock:
    """The time of a node.

    Without ``use_sim_time`` the loop runs on the steady clock and stamps come from the system clock. With it both come
    from ``/clock``, and stand still while nobody publishes there.
    """

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self._jump_handle: Any = None

    @property
    def simulated(self) -> bool:
        """True if time comes from ``/clock``."""
        return bool(self._clock.ros_time_is_active)

    def pace(self) -> float:
        """Return the time for deadlines, intervals and time-outs [s]."""
        return self.stamp_now() if self.simulated else monotonic()

    def stamp_now(self) -> float:
        """Return the time that stamps are compared with [s]."""
        return float(self._clock.now().nanoseconds) * 1e-9

    def on_set_back(self, act: Callable[[], None]) -> None:
        """Calls ``act`` whenever ``/clock`` jumps back, starts or stops."""
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)

        self._jump_handle = self._clock.create_jump_callback(threshold, post_callback=lambda _: act())


def stamp_of(seconds: float) -> Time:
    """Return a time [s] as a stamp; negative times are clamped to zero."""
    nanoseconds = max(round(seconds * 1e9), 0)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def require_one_clock(clock_rate: float, use_sim_time: bool) -> None:
    """Raises `InputError` if a node would both publish ``/clock`` and follow it."""
    if clock_rate > 0.0 and use_sim_time:
        raise InputError(
            "parameter",
            "publish.clock makes this node the source of /clock, use_sim_time makes it follow another; set one of them",
        )
