"""QoS: as the parameters ``qos_overrides.*`` give it, and peers whose QoS does not fit are named, with the policy, also
where discovery brings their names later than their endpoints."""

import math
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import ContactArray, Heightmap

from smartmesh_ros.node.endpoints import NAMELESS, UNKNOWN, incompatible_peers, names_of
from smartmesh_ros.node.fleet.front import Front
from smartmesh_ros.node.outputs import diagnostics
from smartmesh_ros.node.sensor.terrain_sensor import TerrainSensor
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.startup.dds import POLICY_VARIABLE, VARIABLE, use_large_message_profile
from smartmesh_ros.tools.demo.rover import Rover
from smartmesh_ros.tools.demo.terrain_source import TerrainSource
from smartmesh_ros.tools.testing import COLLIDER, Probe, Process, heightmap_message, mesh_message
from tests.memory import needs_shared_memory
from tests.node.shared import LATCHED, Logged, fed, made_with, stamped

# Size of the shared memory that the profile asks for [bytes].
SEGMENT = 128 * 1024**2
RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_a_peer_with_incompatible_qos_or_type_is_named_with_what_would_be_right(probe: Probe) -> None:
    """And an override of a topic that the node does not have, which is of other nodes in a file for all."""
    with probe.running(parameters=nested("/other", "publisher", {"depth": 3})) as process:
        assert probe.diagnostics("connections")["message"] == "no incompatible peers"
        stubborn = rclpy.create_node("stubborn", context=probe.context)
        stubborn.create_publisher(Heightmap, f"{COLLIDER}/heightmap", BEST_EFFORT)
        stubborn.create_subscription(ContactArray, f"{COLLIDER}/contacts", print, LATCHED)
        stubborn.create_publisher(Heightmap, f"{COLLIDER}/joint_commands", 1)

        def named() -> Any:
            found, words = probe.diagnostics("connections"), "incompatible peers on"
            return words in found["message"] and sum(key.startswith(words) for key in found) == 3 and found

        values = probe.wait_for(named)
        stubborn.destroy_node()
        maps, contacts = (values[f"incompatible peers on {COLLIDER}/{topic}"] for topic in ("heightmap", "contacts"))
        assert "/stubborn" in maps and "reliable" in maps
        assert f"qos_overrides.{COLLIDER}/heightmap.subscription.reliability: best_effort at the start" in maps
        assert "/stubborn" in contacts and "transient local" in contacts.lower()
        assert f"qos_overrides.{COLLIDER}/contacts.publisher.durability: transient_local at the start" in contacts
        said = "/stubborn: its type is smartmesh_msgs/msg/Heightmap, and must be sensor_msgs/msg/JointState"
        assert values[f"incompatible peers on {COLLIDER}/joint_commands"] == said and said in process.output
        assert "/probe" not in str(values)
        probe.wait_for(lambda: "'qos_overrides./other.publisher.depth' has no effect so far" in process.output)


def test_a_map_that_was_latched_before_the_node_started_is_not_missed_without_a_word(probe: Probe) -> None:
    """The words name the override with which it is there. A publisher may wait for the clock as the node does: the log
    has no warning of it until the clock runs."""
    latched = probe.node.create_publisher(Heightmap, f"{COLLIDER}/heightmap", LATCHED)
    latched.publish(stamped(probe, heightmap_message(np.zeros((10, 10)))))
    mesh = mesh_message(np.eye(3), [[0, 1, 2]], tile="mesh")
    clock = probe.node.create_publisher(Clock, "/clock", 10)
    name = f"qos_overrides.{COLLIDER}/heightmap.subscription.durability"
    words = f"no map yet: {COLLIDER}/heightmap has a latched publisher; if that sent its map before, set {name}"
    with probe.running(parameters={"use_sim_time": True}) as process:
        probe.wait_for(lambda: words in probe.diagnostics("terrain")["message"])
        assert all(words in probe.diagnostics("terrain")["message"] for _ in range(3))
        assert words not in process.output
        probe.wait_for(lambda: clock.publish(Clock(clock=Time(sec=5))) or words in process.output)
        probe.publishers["terrain_mesh"].publish(mesh)
        status = probe.wait_for(lambda: (found := probe.diagnostics("terrain"))["tiles"] == "1" and found)
        assert status["message"] == words.removeprefix("no map yet: ") + " to transient_local", "others do not hide it"
    with Process("terrain_collider", {name: "transient_local"}) as process:  # not for the probe's own publisher
        probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] == "100", watch=process)


def test_a_source_that_starts_with_the_node_is_no_reason_to_warn(
    now: list[float], monkeypatch: pytest.MonkeyPatch, logged: Logged
) -> None:
    """Its first map may take longer than the diagnostics' second look; later it is one, also without a clock to wait
    for."""
    monkeypatch.setattr(diagnostics, "unheard_latched", lambda *_: "a latched publisher")
    with fed({}) as node:
        for lines in (0, 1):
            node.play(now, 2.5, math.inf, lambda: None)
            assert logged().count("no map yet: a latched publisher") == lines


@needs_shared_memory
def test_large_maps_go_through_with_the_installed_profile(probe: Probe, monkeypatch: pytest.MonkeyPatch) -> None:
    """Source and collider use it, the probe does not: peers with and without it understand each other."""
    for name in (VARIABLE, POLICY_VARIABLE):  # set anew below, and as they were after the test
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    use_large_message_profile()
    # Slowly: the source keeps only its newest map, so that one that is still on its way is given up for the next.
    source = {"rows": 2048, "columns": 2048, "rate": 0.5, "resolution": 0.05}
    with probe.running() as collider, Process("terrain_source", source):
        probe.wait_for(lambda: probe.diagnostics("terrain")["samples"] == str(2048 * 2048))
        lines = Path(f"/proc/{collider.process.pid}/maps").read_text().splitlines()
        segments = [line.split()[0].split("-") for line in lines if "/dev/shm/fastrtps_" in line]
        # Its own and the source's.
        assert sum(int(end, 16) - int(start, 16) >= SEGMENT for start, end in segments) >= 2
        assert "XMLPARSER" not in collider.output


def endpoint(gid: int, name: tuple[str, str] = (UNKNOWN, UNKNOWN), qos: QoSProfile = BEST_EFFORT) -> Any:
    """What the graph tells of a publisher or subscription; ``name``: of its node, and its namespace."""
    about = {"node_name": name[0], "node_namespace": name[1], "topic_type": "", "qos_profile": qos}
    return SimpleNamespace(endpoint_gid=[gid] * 16, **about)


def test_incompatible_peers_are_told_of_by_name() -> None:
    """A node hears maps of two publishers. The second one's name is yet to come, or never will, as of bridges that
    speak DDS without ROS."""
    publishers = [endpoint(1, ("mapper", "/robot")), endpoint(2)]
    graph: Any = SimpleNamespace(
        get_name=lambda: "terrain_collider",
        get_namespace=lambda: "/",
        count_publishers=lambda _: len(publishers),
        get_publishers_info_by_topic=lambda _: publishers,
        get_subscriptions_info_by_topic=lambda _: [endpoint(0, ("terrain_collider", "/"), RELIABLE)],
    )
    subscriptions: Any = [SimpleNamespace(topic_name="/maps", get_publisher_count=lambda: 0)]
    [said] = incompatible_peers(graph, subscriptions, []).values()
    assert "/robot/mapper: " in said and f"{NAMELESS}: " in said and UNKNOWN not in said
    assert names_of(publishers) == sorted([NAMELESS, "/robot/mapper"])
    publishers[1] = endpoint(2, ("other", "/"))
    [said] = incompatible_peers(graph, subscriptions, []).values()
    assert "/other: " in said and NAMELESS not in said
    assert names_of(publishers) == ["/other", "/robot/mapper"]


POLICIES = {"history": "keep_all", "depth": 7, "reliability": "best_effort", "durability": "transient_local"}
# Of each node a topic that it publishes and one that it subscribes to.
TOPICS = [
    (TerrainCollider, "/terrain_collider/body_states", "/terrain_collider/heightmap"),
    (TerrainSource, "/terrain_collider/heightmap", ""),
    (TerrainSensor, "/terrain_sensor/points", ""),
    (Front, "/fleet/timing", "/fleet/node_0/terrain_collider/body_states"),
    (Rover, "/terrain_collider/joint_commands", "/terrain_collider/body_states"),
]


def profiles(kind: Any, parameters: Mapping[str, Any]) -> dict[str, QoSProfile]:
    """QoS of a node's publishers by topic, and of its subscriptions by ``to`` and topic."""
    with made_with(kind, parameters) as node:
        ends = [("", end) for end in node.publishers] + [("to ", end) for end in node.subscriptions]
        return {way + end.topic_name: end.qos_profile for way, end in ends}


@pytest.mark.parametrize(("kind", "published", "subscribed"), TOPICS)
def test_overrides_reach_the_topic_that_they_name_and_no_other(kind: Any, published: str, subscribed: str) -> None:
    before, parameters = profiles(kind, {}), nested(published, "publisher", POLICIES)
    kept = {qos.history for topic, qos in before.items() if not topic.startswith("to ")}
    assert kept == {HistoryPolicy.KEEP_LAST}, "one subscriber that reads nothing could hold a publisher up"
    if subscribed:
        parameters |= nested(subscribed, "subscription", POLICIES)
    after = profiles(kind, parameters)
    changed = {topic: qos for topic, qos in after.items() if qos != before[topic]}
    assert changed.keys() == {published, *([f"to {subscribed}"] if subscribed else [])}
    for qos in changed.values():
        assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_ALL, 7)
        assert qos.reliability == ReliabilityPolicy.BEST_EFFORT
        assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def nested(topic: str, kind: str, policies: Mapping[str, Any]) -> dict[str, Any]:
    return {f"qos_overrides.{topic}.{kind}.{policy}": value for policy, value in policies.items()}
