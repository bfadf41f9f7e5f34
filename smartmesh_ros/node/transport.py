"""What the parts of the collider need of ROS: topics, services, names and time.

rclpy's `Node` is a `Transport` over DDS, and `NodeClock` its `Clock`. `smartmesh_ros.tools.replay` has others, which
pass recorded messages on in this process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.qos import DurabilityPolicy, QoSProfile

# Quality of service of a topic whose late subscribers receive the last message.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def publishers_on(node: Transport, topic: str) -> frozenset[bytes]:
    """Return the identifiers of the publishers that DDS has on a topic, which are new in each process of a node: one
    that was killed stays for seconds beside the next."""
    return frozenset(bytes(one.endpoint_gid) for one in node.get_publishers_info_by_topic(topic))


# Name and type of the topic by which colliders are found.
STATES, STATES_TYPE = "body_states", "smartmesh_msgs/msg/TrackedBodyArray"


def colliders(node: Transport) -> list[str]:
    """Return the full names of the colliders that a node has discovered."""
    return sorted(
        topic.removesuffix(f"/{STATES}")
        for topic, kinds in node.get_topic_names_and_types()
        if topic.endswith(f"/{STATES}") and STATES_TYPE in kinds and node.count_publishers(topic)
    )


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

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any) -> Any: ...
    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], qos_profile: Any, *, raw: bool
    ) -> Any: ...
    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[[Any, Any], Any], *, qos_profile: Any
    ) -> Any: ...
    def destroy_publisher(self, publisher: Any) -> Any: ...
    def destroy_subscription(self, subscription: Any) -> Any: ...
    def get_logger(self) -> Any: ...
    def get_name(self) -> str: ...
    def get_namespace(self) -> str: ...
    def get_fully_qualified_name(self) -> str: ...
    def resolve_topic_name(self, topic: str) -> str: ...
    def count_publishers(self, topic_name: str) -> int: ...
    def count_subscribers(self, topic_name: str) -> int: ...
    def get_publishers_info_by_topic(self, topic_name: str) -> list[Any]: ...
    def get_subscriptions_info_by_topic(self, topic_name: str) -> list[Any]: ...
    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]: ...
    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]: ...
