"""The k-th call to DDS or PyBullet fails in a node, for k = 1, 2, ...: it is counted, and the node goes on."""

import math
from collections import Counter
from collections.abc import Iterator
from types import SimpleNamespace
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
from visualization_msgs.msg import MarkerArray

from smartmesh_ros import BodyState, Box, Sphere
from smartmesh_ros.node.outputs import rates, transform_outputs
from smartmesh_ros.node.outputs.rates import Rhythm
from tests.faults import Faults, bullet_faults
from tests.grounds import level
from tests.node.shared import BALL, Fed, fed
from tests.node.test_robot_outputs import ARM
from tests.urdfs import robot

MAPS = [f"{{body: {name}, size: [1, 1], spacing: 0.1}}" for name in ("lost", "arm")]
PARAMETERS = {"frame_id": "map", "publish.incremental": True, "publish.tf": 50.0, "ground_maps": MAPS}
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
    monkeypatch.setattr(rates, "DISCOVERY_TIME", 0.0)
    monkeypatch.setattr(rates, "ALL_PATCHES_PERIOD", math.inf)
    monkeypatch.setattr(transform_outputs, "LISTENING_TIME", 0.0)
    return Wire(monkeypatch)


@pytest.fixture
def node() -> Iterator[Fed]:
    """A node with a map, a tracked ball and a robot."""
    with fed(PARAMETERS) as made:
        made.world.terrain.put("", level(61))
        made.world.spawn_robot("arm", robot(ARM), BodyState((0.0, 0.0, 0.1)))
        made.world.track("ball", 0.2, BodyState((1.0, 0.0, 0.1)))
        yield made


def failures(node: Fed) -> Counter[str]:
    counts = node.node.refusals.counts.items()
    return Counter({key: count for key, count in counts if key.endswith((": dds", ": pybullet"))})


def publish_all(node: Fed) -> None:
    """Runs a step and publishes every output, due or not."""
    outputs = node.node._outputs
    for output in (outputs._diagnostics, outputs._descriptions, outputs._robot_model):
        output._rhythm = Rhythm()
    outputs._descriptions._sent = outputs._robot_model._sent = None
    node.step(1)


def test_an_output_that_fails_stops_no_other(wire: Wire, node: Fed) -> None:
    node.node.pacer.pause(True)
    publish_all(node)
    everything = wire.topics()
    assert len(everything) == 14, everything
    for number in wire.faults.runs():
        before = failures(node)
        with wire.faults.failing(number):
            publish_all(node)
        new, missing = failures(node) - before, everything - wire.topics()
        assert new.total() == (wire.faults.fired != "")
        assert len(missing) <= new.total(), wire.faults.fired
        if missing:
            assert list(new) == [f"{missing.pop().removeprefix('/terrain_collider').split('/')[1]}: dds"]
    publish_all(node)
    assert wire.topics() == everything


def test_a_body_that_a_step_leaves_nowhere_ends_no_node(wire: Wire, node: Fed) -> None:
    """It is removed in the next step; until then some outputs fail, but markers are of the other bodies."""
    node.node.pacer.pause(True)
    node.world.spawn("lost", Sphere(0.2), 1.0, BodyState((2.0, 0.0, 0.5)))
    publish_all(node)
    everything = wire.topics()
    uid = node.world.body("lost").uid

    def leave_nowhere() -> None:
        node.world.client.resetBasePositionAndOrientation(uid, (math.nan, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))

    node.world.watchers.append(SimpleNamespace(before_step=int, after_step=leave_nowhere))
    publish_all(node)
    node.world.watchers.pop()
    scenes = [deserialize_message(data, MarkerArray) for topic, data in wire.sent if topic.endswith("/scene")]
    assert np.isfinite([marker.pose.position.x for scene in scenes for marker in scene.markers]).all()
    its_map = "/terrain_collider/ground_map/lost"
    assert everything - wire.topics() == {"/tf", its_map}
    assert node.node.refusals.counts == {"tf: non_finite": 1, "ground_map: non_finite": 1}
    publish_all(node)
    assert wire.topics() == everything - {its_map} and "lost" not in node.world.bodies


def test_changes_that_were_not_sent_are_sent_again(wire: Wire, node: Fed) -> None:
    """Of patches, and descriptions."""

    def has_all() -> bool:
        publish_all(node)
        [data] = (message for topic, message in wire.sent if topic == "/terrain_collider/collider_patches")
        wire.sent.clear()
        message = deserialize_message(data, ColliderPatchArray)
        assert message.incremental or len(message.patches) == 2
        return not message.incremental

    node.node.pacer.pause(True)
    assert has_all()
    assert not has_all()
    for number in wire.faults.runs():
        with wire.faults.failing(number):
            publish_all(node)
        lost = "/terrain_collider/collider_patches" not in wire.topics()
        all_again = has_all()
        assert lost or not all_again
        assert all_again or not (lost and wire.faults.fired == "publish")
    descriptions = node.node._outputs._descriptions
    for number in wire.faults.runs():
        descriptions._rhythm, descriptions._sent = Rhythm(), None
        with wire.faults.failing(number), node.node.session.enduring("body_descriptions"):
            descriptions.publish()
        descriptions._rhythm = Rhythm()
        descriptions.publish()
        assert wire.topics() == {"/terrain_collider/body_descriptions"}


def test_a_tick_in_which_pybullet_fails_is_counted(node: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    faults, world = bullet_faults(monkeypatch), node.world
    for number in faults.runs():
        before = failures(node)
        world.terrain.tile("").replace(np.full((61, 61), 0.001 * (number % 2)), time=world.time)
        with faults.failing(number):
            node.run(1)
        assert (failures(node) - before).total() == (faults.fired != "")
    time = world.time
    node.run(1)
    assert world.time > time and not world.lost


def spawn_boxes(node: Fed) -> None:
    for y, name in enumerate(("box", "other"), 1):
        node.world.spawn(name, Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, y, 0.1)))


def test_bodies_that_are_not_removed_are_named_and_the_others_are_gone(
    node: Fed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A piece of ground that stays under none goes with the next look at the bodies."""
    faults, tracking = bullet_faults(monkeypatch), node.node.session.tracking
    client, names = node.world.client, ["box", "ball", "other"]
    count, refused = client.getNumBodies() - 1, 0  # without the ball
    for number in faults.runs():
        spawn_boxes(node)
        tracking.update("ball", 0.2, BodyState((1.0, 0.0, 0.1)), 0.0)
        with faults.failing(number):
            answer = node.call("remove_bodies", RemoveBodies.Request(ids=names))
        still = [name for name in names if name in node.world.bodies]
        assert [failure.id for failure in answer.failures] == still
        assert answer.success == (not still) and (faults.fired or not still)
        refused += len(still)
        assert ("but the others are removed" in answer.message) == bool(still)
        assert all(faults.fired in failure.reason for failure in answer.failures)
        assert tracking.names == (["ball"] if "ball" in still else [])
        assert not still or node.call("remove_bodies", RemoveBodies.Request(ids=still)).success
        assert tracking.names == [] and not node.world.bodies.keys() & {*names}
        assert client.getNumBodies() == count
    assert refused == len(names)


def test_bodies_that_are_not_spawned_are_taken_back_or_named(node: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of them is taken, so that the other must be removed again."""
    faults = bullet_faults(monkeypatch)
    bodies = [BodySpecification(id=name, mass=1.0, shape=BALL) for name in ("new", "arm")]
    for number in faults.runs():
        with faults.failing(number):
            answer = node.call("spawn_bodies", SpawnBodies.Request(bodies=bodies))
        assert not answer.success
        assert "arm" in [failure.id for failure in answer.failures]
        stays = "new" in node.world.bodies
        assert ("some were added and stay, because PyBullet failed: new" in answer.message) == stays
        assert ("so nothing was changed" in answer.message) == (not stays)
        if stays:
            node.world.remove("new")


def test_a_reset_that_fails_names_the_bodies_that_are_not_back(node: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    faults, world = bullet_faults(monkeypatch), node.world
    spawn_boxes(node)
    for number in faults.runs():
        for name in ("box", "other", "arm"):
            world.move(name, BodyState((0.0, 0.0, 5.0), linear=(1.0, 0.0, 0.0)))
        refusal = ""
        with faults.failing(number):
            try:
                node.node.reset()
            except pb.error as error:
                refusal = str(error)
        assert bool(refusal) == bool(faults.fired) and faults.fired in refusal
        for name in ("box", "other", "arm"):
            assert world.state(name) == world.bodies[name].initial or f"'{name}'" in refusal
        node.node.reset()
