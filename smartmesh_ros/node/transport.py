"""What the parts of the collider need of ROS: topics, services, names and time.

rclpy's `Node` is a `Transport` over DDS, and `NodeClock` its `Clock`. `smartmesh_ros.tools.replay` has others, which
pass recorded messages on in this process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol


class Clock(Protocol):
    """The time of a node."""

    @property
    def simulated(self) -> bool:
        """True if time comes from ``/clock``."""

    def steady(self) -> float:
        """Return the time for measurements and periods of outputs, which nobody sets [s]."""

    def pace(self) -> float:
        """Return the time for deadlines, intervals and time-outs [s]."""

    def stamp_now(self) -> float:
        """Return the time that stamps are compared with [s]."""

    def on_set_back(self, act: Callable[[], None]) -> None:
        """Calls ``act`` whenever ``/clock`` jumps back, starts or stops."""


class Transport(Protocol):
    """Topics and services, and the graph of nodes around them, with the names and meanings of rclpy's `Node`.

    Messages are objects or their CDR bytes. Names are relative, private (``~/name``) or full. A publisher has
    ``publish``, ``get_subscription_count``, ``wait_for_all_acked`` and ``topic_name``; a subscription
    ``get_publisher_count`` and ``topic_name``; a service ``send_response``.
    """

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any) -> Any:
        """Return a publisher of messages ``msg_type``."""

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], qos_profile: Any, *, raw: bool
    ) -> Any:
        """Call ``callback`` with each message on a topic; with its bytes if ``raw``."""

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any], *, qos_profile: Any
    ) -> Any:
        """Call ``callback`` with each request and an empty response, and answer with what it returns."""

    def destroy_publisher(self, publisher: Any) -> Any:
        """End a publisher."""

    def destroy_subscription(self, subscription: Any) -> Any:
        """End a subscription."""

    def get_logger(self) -> Any:
        """Return the logger, which has ``info``, ``warning`` and ``error``."""

    def get_name(self) -> str:
        """Return the node's name."""

    def get_namespace(self) -> str:
        """Return the node's namespace."""

    def get_fully_qualified_name(self) -> str:
        """Return the node's namespace and name."""

    def resolve_topic_name(self, topic: str) -> str:
        """Return the full name of a topic, after remapping."""

    def count_publishers(self, topic_name: str) -> int:
        """Return the number of publishers of a topic."""

    def count_subscribers(self, topic_name: str) -> int:
        """Return the number of subscriptions to a topic."""

    def get_publishers_info_by_topic(self, topic_name: str) -> list[Any]:
        """Return rclpy's `TopicEndpointInfo` of each publisher of a topic."""

    def get_subscriptions_info_by_topic(self, topic_name: str) -> list[Any]:
        """Return rclpy's `TopicEndpointInfo` of each subscription to a topic."""

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Return all topics, each with its types ``package/msg/Name``."""

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Return the name and namespace of each node."""
