"""QoS of topics as the parameters ``qos_overrides.*`` give it, in every node of the package."""

from collections.abc import Mapping
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from smartmesh_ros.node.fleet.front import Front
from smartmesh_ros.node.sensor.terrain_sensor import TerrainSensor
from smartmesh_ros.node.soil.soil_node import SoilNode
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.tools.demo.rover import Rover
from smartmesh_ros.tools.demo.terrain_source import TerrainSource
from smartmesh_ros.tools.testing import Probe
from tests.node.shared import made_with, refusal_at_start

POLICIES = {"history": "keep_all", "depth": 7, "reliability": "best_effort", "durability": "transient_local"}
# Of each node a topic that it publishes and one that it subscribes to.
TOPICS = [
    (TerrainCollider, "/terrain_collider/body_states", "/terrain_collider/heightmap"),
    (TerrainSource, "/terrain_collider/heightmap", ""),
    (TerrainSensor, "/terrain_sensor/points", ""),
    (SoilNode, "/terrain_collider/heightmap_update", "/soil/soils"),
    (Front, "/fleet/timing", "/fleet/node_0/terrain_collider/body_states"),
    (Rover, "/terrain_collider/joint_commands", "/terrain_collider/body_states"),
]


def profiles(endpoints: Any) -> dict[str, QoSProfile]:
    return {endpoint.topic_name: endpoint.qos_profile for endpoint in endpoints}


@pytest.mark.parametrize(("kind", "published", "subscribed"), TOPICS)
def test_overrides_reach_the_topic_that_they_name_and_no_other(
    domain: int, kind: Any, published: str, subscribed: str
) -> None:
    with made_with(kind, {}) as node:
        before = profiles(node.publishers) | {f"to {topic}": qos for topic, qos in profiles(node.subscriptions).items()}
    parameters = nested(published, "publisher", POLICIES)
    if subscribed:
        parameters |= nested(subscribed, "subscription", POLICIES)
    with made_with(kind, parameters) as node:
        after = profiles(node.publishers) | {f"to {topic}": qos for topic, qos in profiles(node.subscriptions).items()}
    changed = {topic for topic in before if after[topic] != before[topic]}
    assert changed == {published, *([f"to {subscribed}"] if subscribed else [])}
    for topic in changed:
        qos = after[topic]
        assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_ALL, 7)
        assert qos.reliability == ReliabilityPolicy.BEST_EFFORT
        assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def nested(topic: str, kind: str, policies: Mapping[str, Any]) -> dict[str, Any]:
    return {f"qos_overrides.{topic}.{kind}.{policy}": value for policy, value in policies.items()}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("/terrain_collider/heightmap.subscription.reliability", "often", "reliable, best_effort"),
        ("/terrain_collider/heightmap.subscription.reliability", 1, "reliable, best_effort"),
        ("/terrain_collider/heightmap.subscription.durability", "", "transient_local"),
        ("/terrain_collider/heightmap.subscription.history", True, "keep_last, keep_all"),
        ("/terrain_collider/heightmap.subscription.depth", 0, "1 to"),
        ("/terrain_collider/heightmap.subscription.depth", -3, "1 to"),
        ("/terrain_collider/heightmap.subscription.depth", 2**40, "1 to"),
        ("/terrain_collider/heightmap.subscription.depth", "ten", "1 to"),
        ("/terrain_collider/heightmap.subscription.depth", 5.0, "1 to"),
        ("/terrain_collider/heightmap.subscription.speed", 5, "history, depth, reliability, durability"),
        ("/terrain_collider/heightmap.subscriber.depth", 5, "publisher or subscription"),
        ("terrain_collider/heightmap.subscription.depth", 5, "full name"),
        ("depth", 5, "qos_overrides.<topic>"),
    ],
)
def test_overrides_that_are_not_possible_are_refused(domain: int, name: str, value: Any, words: str) -> None:
    said = refusal_at_start({f"qos_overrides.{name}": value})
    assert f"qos_overrides.{name}" in said
    assert words in said


def test_an_override_of_a_topic_that_the_node_does_not_have_is_warned_about(probe: Probe) -> None:
    """Not refused: a parameter file for all nodes names topics of other nodes as well."""
    with probe.running(parameters=nested("/other", "publisher", {"depth": 3})) as process:
        words = "'qos_overrides./other.publisher.depth' has no effect so far"
        probe.wait_for(lambda: words in process.output)
