"""The ends of the node's topics: its own inputs and outputs, the names of peers, and those with another type or an
incompatible quality of service (QoS).

DDS discovery finds a publisher or subscription before its node's name arrives. DDS programs without ROS never send one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import product
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSCompatibility, qos_check_compatible

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.transport import LATCHED, Transport

# Name in the ROS graph of a node whose name has not arrived.
UNKNOWN = "_NODE_NAME_UNKNOWN_"
NAMELESS = "a DDS participant without a ROS name"


def names_of(endpoints: Iterable[Any]) -> list[str]:
    """Return the distinct full names of the nodes of some `TopicEndpointInfo`, sorted; `NAMELESS` for those whose name
    has not arrived, or never will."""
    return sorted({
        NAMELESS
        if UNKNOWN in (one.node_name, one.node_namespace)
        else f"{one.node_namespace.rstrip('/')}/{one.node_name}"
        for one in endpoints
    })  # fmt: skip


class OwnTopics:
    """The node's input and output topics. An input on an own output is refused, because a tracked body would then
    overlap the simulated robot that it copies.

    ``taken``, ``published``: full name -> name in the node or its parameters.
    ``resolve``: returns the full, remapped name of a topic."""

    def __init__(self, resolve: Callable[[str], str]) -> None:
        self.taken: dict[str, str] = {}
        self.published: dict[str, str] = {}
        self._resolve = resolve

    def register(self, given: str, names: dict[str, str]) -> str:
        """Enter an input into ``taken`` before its subscription, or an output into ``published`` before its publisher;
        return its full name. Raises `InputError` if it is both."""
        try:
            topic = self._resolve(given)
        except (ValueError, rclpy_implementation.RCLError) as error:
            raise InputError("topic", f"{given!r} is no topic: {str(error).partition(', at ')[0]}") from None
        names[topic] = given
        if topic in self.taken and topic in self.published:
            words = f"the input {self.taken[topic]!r} is {topic}, which this node publishes as {self.published[topic]}"
            raise InputError("own_topic", f"{words}; remap one of them elsewhere, or choose another input")
        return topic


def incompatible_peers(node: Transport, subscriptions: Iterable[Any], publishers: Iterable[Any]) -> dict[str, str]:
    """Return a description of the peers whose type or QoS is incompatible with the node's, and what would be right, by
    topic.

    Costs two counts per topic if all peers are connected. A peer that is about to connect is not reported, because the
    types and policies themselves are compared.
    """
    heard = ((end.topic_name, end.get_publisher_count(), node.count_publishers) for end in subscriptions)
    told = ((end.topic_name, end.get_subscription_count(), node.count_subscribers) for end in publishers)
    own = (node.get_name(), node.get_namespace())
    found: dict[str, list[str]] = {}
    for topic in [topic for topic, connected, count in (*heard, *told) if count(topic) > connected]:
        # The node's own policies also come from the graph, because only the graph resolves defaults.
        ends = product(node.get_publishers_info_by_topic(topic), node.get_subscriptions_info_by_topic(topic))
        for publisher, subscription in ends:
            is_own = [(end.node_name, end.node_namespace) == own for end in (publisher, subscription)]
            if is_own[0] == is_own[1]:
                continue
            kind = "publisher" if is_own[0] else "subscription"
            mine, peer = (publisher, subscription) if is_own[0] else (subscription, publisher)
            compatible, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
            if peer.topic_type != mine.topic_type:
                words = f"its type is {peer.topic_type}, and must be {mine.topic_type}"
            elif compatible == QoSCompatibility.ERROR:
                cure = f"{_qos_cure(publisher, subscription, peer, f'qos_overrides.{topic}.{kind}')} at the start"
                cure += f" changes this node's {kind}"
                words = f"{reason.replace('ERROR: ', '').strip('; ')}; {cure}"
            else:
                continue
            found.setdefault(topic, []).append(f"{names_of([peer])[0]}: {words}")
    return {topic: "; ".join(peers) for topic, peers in found.items()}


def _qos_cure(publisher: Any, subscription: Any, peer: Any, parameters: str) -> str:
    """Return the ``parameters`` of an end that give it the policies of the ``peer`` where the publisher offers less
    than the subscription requests: a lower value is the stronger one."""
    policies = ("reliability", "durability")
    wrong = [one for one in policies if getattr(publisher.qos_profile, one) > getattr(subscription.qos_profile, one)]
    right = [f"{parameters}.{one}: {getattr(peer.qos_profile, one).name.lower()}" for one in wrong]
    return " and ".join(right) or f"{parameters}.<policy>"


def unheard_latched(node: Transport, subscriptions: Iterable[Any]) -> str:
    """Return why a message that was published once may not arrive: the topic of a latched publisher and of a
    subscription that is not. Empty if there is none."""
    own = (node.get_name(), node.get_namespace())
    for topic in [end.topic_name for end in subscriptions if end.get_publisher_count()]:
        ends = node.get_subscriptions_info_by_topic(topic)
        taken = [end.qos_profile.durability for end in ends if (end.node_name, end.node_namespace) == own]
        given = [end.qos_profile.durability for end in node.get_publishers_info_by_topic(topic)]
        if LATCHED.durability in given and taken and LATCHED.durability not in taken:
            parameter = f"qos_overrides.{topic}.subscription.durability"
            return f"{topic} has a latched publisher; if that sent its map before, set {parameter} to transient_local"
    return ""
