"""Peers on the node's topics, those with an incompatible quality of service (QoS), and nodes of the same name."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from smartmesh_ros.node.endpoint_names import EndpointNames


def incompatible_peers(
    node: Node, subscriptions: Iterable[Any], publishers: Iterable[Any], names: EndpointNames
) -> dict[str, str]:
    """Return a description of the peers whose QoS is incompatible with the node's, by topic.

    Costs two counts per topic if all peers are connected. A peer that is about to connect is not reported, because the
    policies themselves are compared. A peer is left out until its name has arrived.
    """
    heard = ((end.topic_name, end.get_publisher_count(), node.count_publishers) for end in subscriptions)
    told = ((end.topic_name, end.get_subscription_count(), node.count_subscribers) for end in publishers)
    own = (node.get_name(), node.get_namespace())
    found: dict[str, list[str]] = {}
    for topic in [topic for topic, connected, count in (*heard, *told) if count(topic) > connected]:
        # The node's own policies also come from the graph, because only the graph resolves defaults.
        ends = product(node.get_publishers_info_by_topic(topic), node.get_subscriptions_info_by_topic(topic))
        for pair in ends:
            peers = [end for end in pair if (end.node_name, end.node_namespace) != own]
            compatible, reason = qos_check_compatible(*(end.qos_profile for end in pair))
            if len(peers) == 1 and compatible == QoSCompatibility.ERROR and (name := names.of(peers[0])) is not None:
                found.setdefault(topic, []).append(f"{name}: {reason.replace('ERROR: ', '').strip('; ')}")
    return {topic: "; ".join(peers) for topic, peers in found.items()}


def publishers_of(subscriptions: Iterable[Any]) -> dict[str, int]:
    """Return the number of connected publishers by topic."""
    return {endpoint.topic_name: endpoint.get_publisher_count() for endpoint in subscriptions}


class Namesakes:
    """Logs a warning whenever another node of the same full name appears, which hears and answers the same calls."""

    def __init__(self, node: Node) -> None:
        self._node, self._known = node, 0

    def check(self) -> None:
        """Checks for such nodes; once a second is often enough."""
        node = self._node
        count = node.get_node_names_and_namespaces().count((node.get_name(), node.get_namespace())) - 1
        if count > self._known:
            node.get_logger().warning(
                f"another node is called {node.get_fully_qualified_name()}, or was until seconds ago: both hear the "
                "same topics, and either answers calls meant for the other; give one a namespace (-r __ns:=/name) or "
                "another ROS_DOMAIN_ID"
            )
        self._known = count
