"""The k-th call to DDS or PyBullet fails in a node, for k = 1, 2, ...: it is counted, and the node goes on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from smartmesh_msgs.msg import BodySpecification, ColliderPatchArray
from smartmesh_msgs.srv import RemoveBodies, SpawnBodies

from smartmesh_ros import BodyState, Box, HeightMap
from smartmesh_ros.node.outputs import audience, transform_outputs
from smartmesh_ros.node.terrain_collider import TerrainCollider
from tests.faults import Faults, bullet_faults
from tests.node.shared import BALL, made_with
from tests.node.test_robot_outputs import ARM
from tests.urdfs import robot

PARAMETERS = {"frame_id": "map", "publish.incremental": True, "publish.tf": 50.0}
# Calls to DDS.
FAILING = {
    Publisher: ["publish", "get_subscription_count"],
    Subscription: ["get_publisher_count"],
    Node: ["count_publishers", "count_subscribers", "get_node_names_and_namespaces"],
}


class Wire:
    """What a node publishes, whose outputs all have one subscriber."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.faults = Faults()
        self.sent: list[tuple[str, Any]] = []

        def publish(publisher: Publisher, message: Any) -> None:
            if publisher.topic_name != "/parameter_events":
                self.sent.append((publisher.topic_name, message))

        monkeypatch.setattr(Publisher, "get_subscription_count", lambda _: 1)
        monkeypatch.setattr(Publisher, "publish", publish)
        for kind, names in FAILING.items():
            for name in names:
                call = self.faults.counted(name, getattr(kind, name), rclpy_implementation.RCLError)
                monkeypatch.setattr(kind, name, call)

    def topics(self) -> set[str]:
        """Topics of what was sent since the last call."""
        topics = {topic for topic, _ in self.sent}
        self.sent.clear()
        return topics


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    monkeypatch.setattr(audience, "DISCOVERY_TIME", 0.0)
    monkeypatch.setattr(transform_outputs, "LISTENING_TIME", 0.0)
    return Wire(monkeypatch)


@pytest.fixture
def node() -> Iterator[TerrainCollider]:
    """A node with a map, a tracked ball and a robot."""
    with made_with(TerrainCollider, PARAMETERS) as made:
        world = made.session.world
        world.terrain.put("", HeightMap(np.zeros((61, 61)), resolution=0.1, origin=(-3.0, -3.0)))
        world.spawn_robot("arm", robot(ARM), BodyState((0.0, 0.0, 0.1)))
        world.track("ball", 0.2, BodyState((1.0, 0.0, 0.1)))
        yield made


def failures(node: TerrainCollider) -> Counter[str]:
    return Counter({key: count for key, count in node.refusals.counts.items() if key.endswith((": dds", ": pybullet"))})


def publish_all(node: TerrainCollider) -> None:
    """Runs a step and publishes every output, due or not."""
    outputs = node._outputs
    outputs._diagnostics._due = outputs._descriptions._due = outputs._robot_model._due = 0.0
    outputs._descriptions._sent = outputs._robot_model._sent = None
    node.step(1)


def test_an_output_that_fails_stops_no_other(wire: Wire, node: TerrainCollider) -> None:
    node.pause(True)
    publish_all(node)
    everything = wire.topics()
    assert len(everything) == 13, everything
    for number in wire.faults.runs():
        before = failures(node)
        with wire.faults.failing(number):
            publish_all(node)
        new, missing = failures(node) - before, everything - wire.topics()
        assert new.total() == (wire.faults.fired != "")
        assert len(missing) <= new.total(), wire.faults.fired
        if missing:
            assert list(new) == [f"{missing.pop().rpartition('/')[2]}: dds"]
    publish_all(node)
    assert wire.topics() == everything


def test_changes_that_were_not_sent_are_sent_again(wire: Wire, node: TerrainCollider) -> None:
    """Of patches, and descriptions."""

    def has_all() -> bool:
        publish_all(node)
        [data] = (message for topic, message in wire.sent if topic == "/terrain_collider/collider_patches")
        wire.sent.clear()
        message = deserialize_message(data, ColliderPatchArray)
        assert message.incremental or len(message.patches) == 2
        return not message.incremental

    node.pause(True)
    assert has_all()
    assert not has_all()
    for number in wire.faults.runs():
        with wire.faults.failing(number):
            publish_all(node)
        lost = "/terrain_collider/collider_patches" not in wire.topics()
        all_again = has_all()
        assert lost or not all_again
        assert all_again or not (lost and wire.faults.fired == "publish")
    descriptions = node._outputs._descriptions
    for number in wire.faults.runs():
        descriptions._due, descriptions._sent = 0.0, None
        with wire.faults.failing(number), node.session.enduring("body_descriptions"):
            descriptions.publish()
        descriptions._due = 0.0
        descriptions.publish()
        assert wire.topics() == {"/terrain_collider/body_descriptions"}


def test_a_tick_in_which_pybullet_fails_is_counted(node: TerrainCollider, monkeypatch: pytest.MonkeyPatch) -> None:
    faults, world = bullet_faults(monkeypatch), node.session.world
    for number in faults.runs():
        before = failures(node)
        world.terrain.tile("").replace(np.full((61, 61), 0.001 * (number % 2)), time=world.time)
        with faults.failing(number):
            node.tick()
        assert (failures(node) - before).total() == (faults.fired != "")
    time = world.time
    node.tick()
    assert world.time > time
    assert not world.lost


def test_bodies_that_are_not_removed_are_named_and_the_others_are_gone(
    node: TerrainCollider, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults, session = bullet_faults(monkeypatch), node.session
    for number in faults.runs():
        session.world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 1.0, 0.1)))
        session.world.spawn("other", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 2.0, 0.1)))
        session.tracking.update("ball", 0.2, BodyState((1.0, 0.0, 0.1)), 0.0)
        answer, names = RemoveBodies.Response(), ["box", "ball", "other"]
        with faults.failing(number):
            answered(node, node._body_services._on_remove_all, RemoveBodies.Request(ids=names), answer)
        still = [name for name in names if name in session.world.bodies]
        assert [failure.id for failure in answer.failures] == still
        assert answer.success == (not still) == (not faults.fired)
        assert ("but the others are removed" in answer.message) == bool(still)
        assert all(faults.fired in failure.reason for failure in answer.failures)
        assert session.tracking.names == (["ball"] if "ball" in still else [])
        if still:
            answered(node, node._body_services._on_remove_all, RemoveBodies.Request(ids=still), answer)
            assert answer.success
            assert session.tracking.names == []


def test_bodies_that_are_not_spawned_are_taken_back_or_named(
    node: TerrainCollider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of them is taken, so that the other must be removed again."""
    faults, world = bullet_faults(monkeypatch), node.session.world
    bodies = [BodySpecification(id=name, mass=1.0, shape=BALL) for name in ("new", "arm")]
    for number in faults.runs():
        with faults.failing(number):
            request, answer = SpawnBodies.Request(bodies=bodies), SpawnBodies.Response()
            answered(node, node._body_services._on_spawn_all, request, answer)
        assert not answer.success
        assert "arm" in [failure.id for failure in answer.failures]
        stays = "new" in world.bodies
        assert ("some were added and stay, because PyBullet failed: new" in answer.message) == stays
        assert ("so nothing was changed" in answer.message) == (not stays)
        if stays:
            world.remove("new")


def test_a_reset_that_fails_names_the_bodies_that_are_not_back(
    node: TerrainCollider, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults, world = bullet_faults(monkeypatch), node.session.world
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 1.0, 0.1)))
    world.spawn("other", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 2.0, 0.1)))
    for number in faults.runs():
        for name in ("box", "other", "arm"):
            world.move(name, BodyState((0.0, 0.0, 5.0), linear=(1.0, 0.0, 0.0)))
        refusal = ""
        with faults.failing(number):
            try:
                node.reset()
            except pb.error as error:
                refusal = str(error)
        assert bool(refusal) == bool(faults.fired)
        assert faults.fired in refusal
        for name in ("box", "other", "arm"):
            assert world.state(name) == world.bodies[name].initial or f"'{name}'" in refusal
        node.reset()


def answered(node: TerrainCollider, handle: Any, request: Any, response: Any) -> Any:
    """Do all turns of an answer."""
    steps = node.session.answered("service", handle, request, response)
    try:
        while True:
            steps.send(None)
    except StopIteration as end:
        return end.value
