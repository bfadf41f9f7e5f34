"""Decks over ROS: their frames come by TF, odometry and bodies, their maps on the usual topics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from smartmesh_msgs.msg import HeightmapUpdate
from smartmesh_msgs.srv import QueryGround
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Box, Sphere
from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.timing.stamps import stamp_seconds
from smartmesh_ros.tools.testing import Probe, heightmap_message, mesh_message
from tests.core import mesh_parts
from tests.node.shared import fed, spawn, stamped, transform_message

FERRY = "{deck: ferry, frame: ferry/base_link, thickness: 0.5, at: [0, 0, 0.5]}"
BARGE = "{deck: barge, odometry: /barge/odom, thickness: 0.5}"
LIFT = "{deck: cage, body: platform, thickness: 0.2, at: [0, 0, 0.3]}"
FLAT = np.zeros((21, 21))
ORIGIN = (-2.5, -2.5, 0.0)
HEAVE, RATE = 0.3, 1.5  # [m], [rad/s]


def heave(time: float) -> float:
    """Height of both ships' frames [m]."""
    return 2.0 + HEAVE * math.sin(RATE * time)


@contextmanager
def sailing(probe: Probe) -> Iterator[None]:
    """Both ships heave, 10 m to either side: one on /tf, the other on its odometry."""
    frames = probe.node.create_publisher(TFMessage, "/tf", 10)
    odometry = probe.node.create_publisher(Odometry, "/barge/odom", 10)

    def publish() -> None:
        now = probe.now()
        time = stamp_seconds(now)
        assert time is not None
        frame = transform_message(probe, "map", "ferry/base_link", (10.0, 0.0, heave(time)))
        frame.header.stamp = now
        frames.publish(TFMessage(transforms=[frame]))
        message = stamped(probe, Odometry(child_frame_id="barge"))
        message.header.stamp = now
        message.pose.pose.position.x, message.pose.pose.position.z = -10.0, heave(time)
        message.pose.pose.orientation.w = 1.0
        message.twist.twist.linear.z = HEAVE * RATE * math.cos(RATE * time)
        odometry.publish(message)

    timer = probe.node.create_timer(0.02, publish)
    try:
        yield
    finally:
        probe.node.destroy_timer(timer)


def test_bodies_ride_on_decks_that_follow_a_frame_and_an_odometry(probe: Probe) -> None:
    parameters = {"decks": [FERRY, BARGE], "frame_id": "map", "physics.sleep": True}
    with probe.running(parameters=parameters), sailing(probe):

        def is_there(x: float, low: float, high: float) -> bool:
            [z] = probe.call("query_ground", QueryGround, x=[x], y=[0.0]).z
            return low <= z <= high

        probe.publish_map(np.zeros((41, 41)), resolution=1.0, origin=(-20.0, -20.0, 0.0))
        probe.wait_for(lambda: is_there(0.0, 0.0, 0.0))
        probe.publish_map(FLAT, resolution=0.25, origin=ORIGIN, tile="ferry", frame_id="ferry/base_link")
        probe.publish_map(FLAT, resolution=0.25, origin=ORIGIN, tile="barge", frame_id="")
        probe.wait_for(lambda: is_there(10.0, 2.2, 2.8) and is_there(-10.0, 1.7, 2.3))
        spawn(probe, "on_ferry", (10.0, 0.0, 3.1))
        spawn(probe, "on_barge", (-10.0, 0.0, 2.6))
        spawn(probe, "below", (11.0, 0.0, 0.3))
        states = probe.received[probe.topic("body_states")]

        def errors() -> list[float]:
            found = [1.0] if len(states) < 30 else []
            for message in states[-30:]:
                time = stamp_seconds(message.header.stamp)
                assert time is not None
                z = {body.id: body.pose.position.z for body in message.bodies}
                decks = {"on_ferry": heave(time) + 0.5, "on_barge": heave(time), "below": 0.0}
                found += [abs(z.get(name, math.inf) - 0.2 - height) for name, height in decks.items()]
            return found

        probe.wait_for(lambda: max(errors()) < 0.02)


def test_a_body_of_the_simulation_carries_a_deck_with_maps_updates_and_meshes(domain: int) -> None:
    with fed({"decks": [LIFT], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(np.zeros((41, 41)), resolution=1.0, origin=(-20.0, -20.0, 0.0)))
        deck = heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile="cage", frame_id="cage")
        node.give("heightmap", deck)
        assert not node.world.terrain.decks  # before its body is there
        node.world.spawn("platform", Box(2.0, 2.0, 0.4), 50.0, BodyState((0.0, 0.0, 0.2)))
        node.run(2)
        assert list(node.world.terrain.decks) == ["cage"]
        assert node.heights([0.0, 4.0], [0.0, 0.0]) == pytest.approx([0.5, 0.0], abs=1e-3)
        node.world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.1, 0.1, 0.7)))
        node.run(240)
        assert node.world.state("ball").position[2] == pytest.approx(0.6, abs=2e-3)
        [odometry], frame = node.node._outputs._make_odometry(), node.world.terrain.deck("cage").frame(node.world.time)
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "cage")
        at = odometry.pose.pose.position
        assert [at.x, at.y, at.z] == frame.position.tolist()
        update = HeightmapUpdate(tile="cage", x=8, y=8, width=5, height=5)
        update.header.frame_id, update.heights = "cage", floats(np.full(25, 0.25, np.float32))
        node.give("heightmap_update", stamped(node, update, "cage"))
        node.run(120)
        assert node.heights(0.0, 0.0) == pytest.approx(0.75, abs=1e-3)
        assert node.world.state("ball").position[2] == pytest.approx(0.85, abs=2e-2)
        vertices, triangles = mesh_parts.sheet(1.0, 4)
        roof = mesh_message(vertices + [0.0, 0.0, 3.0], triangles, tile="cage/roof", frame_id="cage")
        node.give("terrain_mesh", roof)
        assert node.heights(0.0, 0.0) == pytest.approx(3.5, abs=1e-3)
        assert set(node.world.terrain.decks["cage"].tiles) == {"", "roof"}
        state = node.world.save()
        node.node.take_restored()
        node.world.step(60)
        before = node.world.snapshot()
        node.world.remove("ball")
        node.world.terrain.remove("cage")
        node.world.carry("cage", None)
        node.world.restore(state)
        node.node.take_restored()
        node.world.step(60)
        assert node.world.snapshot() == before
        node.run(1)
        wrong = heightmap_message(FLAT, tile="cage", frame_id="map")
        node.require_refused("heightmap", [("frame", wrong)])
        removal = heightmap_message(np.zeros((0, 0)), tile="cage", frame_id="cage")
        node.give("heightmap", removal)
        assert set(node.world.terrain.decks["cage"].tiles) == {"roof"}


def test_maps_in_the_frame_of_a_deck_are_its_maps_and_a_reset_keeps_them(domain: int) -> None:
    with fed({"decks": [FERRY], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, frame_id="ferry/base_link"))
        assert node.world.terrain.empty

        def sail(height: float) -> None:
            pose: TransformStamped = transform_message(node, "map", "ferry/base_link", (0.0, 0.0, height))
            node.give("/tf", TFMessage(transforms=[pose]), steps=1)

        sail(2.0)
        assert node.heights(0.0, 0.0) == pytest.approx(2.5)
        node.node.reset()
        sail(3.0)
        assert node.heights(0.0, 0.0) == pytest.approx(3.5)
        sail(3.1)
        node.run(240)
        assert node.heights(0.0, 0.0) == pytest.approx(3.6, abs=0.5)  # a frame moves on for a while
        assert not node.world.terrain.decks["ferry"].moving(node.world.time)
