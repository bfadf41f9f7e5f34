"""Peers on the node's topics, and those with an incompatible quality of service."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from smartmesh_ros.node.endpoint_names import EndpointNames


def incompatible_peers(
    node: Node, subscriptions: Iterable[Any], publishers: Iterable[Any], names: EndpointNames
) -> dict[str, str]:
    """Return a description of the peers whose quality of service (QoS) is incompatible with the node's, by topic.

    Costs two counts per topic if all peers are connected. A peer that is about to connect is not reported, because the
    policies themselves are compared. A peer is left out until its name has arrived.
    """
    found: dict[str, list[str]] = {}
    own = (node.get_name(), node.get_namespace())
    for endpoint in subscriptions:
        topic = endpoint.topic_name
        if node.count_publishers(topic) > endpoint.get_publisher_count():
            # The node's own policies also come from the graph, because only the graph resolves defaults.
            ours = _of(node.get_subscriptions_info_by_topic(topic), own)
            peers = node.get_publishers_info_by_topic(topic)
            _note(found, names, topic, [(peer, peer, mine) for peer in peers for mine in ours])
    for endpoint in publishers:
        topic = endpoint.topic_name
        if node.count_subscribers(topic) > endpoint.get_subscription_count():
            ours = _of(node.get_publishers_info_by_topic(topic), own)
            peers = node.get_subscriptions_info_by_topic(topic)
            _note(found, names, topic, [(peer, mine, peer) for peer in peers for mine in ours])
    return {topic: "; ".join(peers) for topic, peers in found.items()}


def publishers_of(subscriptions: Iterable[Any]) -> dict[str, int]:
    """Return the number of connected publishers by topic."""
    return {endpoint.topic_name: endpoint.get_publisher_count() for endpoint in subscriptions}


def _of(endpoints: list[Any], node: tuple[str, str]) -> list[Any]:
    return [endpoint for endpoint in endpoints if (endpoint.node_name, endpoint.node_namespace) == node][:1]


def _note(found: dict[str, list[str]], names: EndpointNames, topic: str, pairs: list[tuple[Any, Any, Any]]) -> None:
    """Adds the incompatible peers of ``pairs`` (peer, offering endpoint, requesting endpoint) to ``found``."""
    for peer, offers, requests in pairs:
        compatibility, reason = qos_check_compatible(offers.qos_profile, requests.qos_profile)
        if compatibility == QoSCompatibility.ERROR and (name := names.of(peer)) is not None:
            found.setdefault(topic, []).append(f"{name}: {reason.replace('ERROR: ', '').strip('; ')}")
