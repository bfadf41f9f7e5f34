"""Names of nodes that discovery brings later than their endpoints."""

from types import SimpleNamespace
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy

from smartmesh_ros.node.endpoints import NAME_TIMEOUT, NAMELESS, UNKNOWN, EndpointNames, incompatible_peers

RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
UNNAMED = (UNKNOWN, UNKNOWN)


def endpoint(gid: int, name: tuple[str, str], qos: QoSProfile = BEST_EFFORT) -> Any:
    """What the graph tells of a publisher or subscription; ``name``: of its node, and its namespace."""
    return SimpleNamespace(endpoint_gid=[gid] * 16, node_name=name[0], node_namespace=name[1], qos_profile=qos)


def graph_of_two_publishers() -> Any:
    """A node that hears maps of two publishers, as the graph tells it. The second one's name is yet to come."""
    publishers = [endpoint(1, ("mapper", "/robot")), endpoint(2, UNNAMED)]
    return SimpleNamespace(
        publishers=publishers,
        subscription=SimpleNamespace(topic_name="/maps", get_publisher_count=lambda: 0),
        get_name=lambda: "terrain_collider",
        get_namespace=lambda: "/",
        count_publishers=lambda _: len(publishers),
        get_publishers_info_by_topic=lambda _: publishers,
        get_subscriptions_info_by_topic=lambda _: [endpoint(0, ("terrain_collider", "/"), RELIABLE)],
    )


def test_rivals_are_named_once_the_names_of_all_have_arrived() -> None:
    graph, names = graph_of_two_publishers(), EndpointNames()
    assert names.of_publishers(graph, ["/maps"]) is None
    graph.publishers[1] = endpoint(2, ("other", "/"))
    assert names.of_publishers(graph, ["/maps"]) == ["/other", "/robot/mapper"]


def test_a_peer_that_does_not_fit_is_told_of_once_its_name_has_arrived() -> None:
    graph, names = graph_of_two_publishers(), EndpointNames()
    [said] = incompatible_peers(graph, [graph.subscription], [], names).values()
    assert "/robot/mapper" in said
    assert UNKNOWN not in said
    graph.publishers[1] = endpoint(2, ("other", "/"))
    [said] = incompatible_peers(graph, [graph.subscription], [], names).values()
    assert "/other" in said


def test_a_program_that_never_sends_a_name_is_told_of_after_a_while() -> None:
    """As bridges do that speak DDS without ROS."""
    now = [100.0]
    names = EndpointNames(lambda: now[0])
    nameless = endpoint(2, UNNAMED)
    assert names.of(nameless) is None
    now[0] += 0.9 * NAME_TIMEOUT
    assert names.of(nameless) is None
    assert names.of(endpoint(3, UNNAMED)) is None
    now[0] += 0.2 * NAME_TIMEOUT
    assert names.of(nameless) == NAMELESS
    assert names.of(endpoint(3, UNNAMED)) is None, "each has its own time"
    assert names.of(endpoint(2, ("late", "/"))) == "/late"
