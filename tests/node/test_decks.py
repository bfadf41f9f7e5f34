"""Decks over ROS: their frames come by TF, odometry and bodies, their maps on the usual topics."""

import math
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from smartmesh_msgs.msg import HeightmapUpdate
from smartmesh_msgs.srv import RestoreState, SaveState, SpawnBody, StartEpisode
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Box, InputError
from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.testing import heightmap_message, mesh_message, pose_message
from tests.core import mesh_parts
from tests.node.shared import Logged, fed, stamped, transform_message
from tests.urdfs import ROVER

FERRY = "{deck: ferry, frame: ferry/base_link, thickness: 0.5, at: [0, 0, 0.5]}"
BARGE = "{deck: barge, odometry: /barge/odom, thickness: 0.5}"
LIFT = "{deck: cage, body: platform, thickness: 0.2, at: [0, 0, 0.3]}"
FLAT = np.zeros((21, 21))
ORIGIN = (-2.5, -2.5, 0.0)
HEAVE, RATE = 0.3, 1.5  # [m], [rad/s]


def heave(time: float) -> float:
    """Height of both ships' frames [m]."""
    return 2.0 + HEAVE * math.sin(RATE * time)


def odometry_message(x: float, z: float, speed: float) -> Odometry:
    """Of the barge at a place [m], which rises [m/s]."""
    message = Odometry(child_frame_id="barge")
    message.pose.pose, message.twist.twist.linear.z = pose_message((x, 0.0, z)), speed
    return message


def test_decks_follow_a_frame_and_an_odometry(now: list[float]) -> None:
    """Both ships heave, 10 m to either side: one on /tf, the other on its odometry. How bodies ride on them:
    tests/ground/test_decks.py."""
    with fed({"decks": [FERRY, BARGE], "frame_id": "map"}) as node:

        def sail() -> None:
            frame = transform_message(node, "map", "ferry/base_link", (10.0, 0.0, heave(now[0])))
            message = stamped(node, odometry_message(-10.0, heave(now[0]), HEAVE * RATE * math.cos(RATE * now[0])))
            frame.header.stamp = message.header.stamp = stamp_of(now[0])
            node.give("/tf", TFMessage(transforms=[frame]), steps=0)
            node.give("/barge/odom", message, steps=0)

        def error() -> float:
            ship = heave(node.node.session.state_time())
            return float(np.abs(node.heights([10.0, -10.0], [0.0, 0.0]) - (ship + 0.5, ship)).max())

        for tile, frame in (("ferry", "ferry/base_link"), ("barge", "")):
            node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile=tile, frame_id=frame))
        assert max(node.play(now, 4.0, 0.02, sail, error)[240:]) < 1e-4
        _, words, values = node.node._outputs._diagnostics._terrain()
        assert "pose" not in words and float(values["age of deck 'ferry' [s]"]) < 0.1
        now[0] += 3.0
        level, words, values = node.node._outputs._diagnostics._terrain()
        assert level == DiagnosticStatus.WARN and words == "no pose comes of the decks barge, ferry, which rest"
        assert values["tiles of deck 'ferry'"] == 1


def test_decks_without_a_pose_are_told_of_until_they_are_ground() -> None:
    """One follows a topic, and one a body that is not there yet."""
    with fed({"decks": [BARGE, LIFT], "frame_id": "map"}) as node:

        def tell() -> str:
            return str(node.node._outputs._diagnostics._terrain()[1])

        assert tell() == "no map yet"
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile="barge", frame_id=""))
        words = "of whose frame, topic or body no pose came"
        assert tell() == f"no ground yet: the decks barge, cage, {words}"
        node.give("/barge/odom", stamped(node, odometry_message(10.0, 1.0, 0.0)), steps=1)
        assert tell() == f"no ground yet: the decks cage, {words}"
        node.world.spawn("platform", Box(1.0, 1.0, 0.2), 100.0, BodyState((0.0, 0.0, 1.0)))
        node.run(1)
        assert tell() == "maps arrive"


def test_a_deck_moves_on_at_the_velocity_that_its_odometry_states() -> None:
    with fed({"decks": [BARGE], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile="barge", frame_id=""))
        node.give("/barge/odom", stamped(node, odometry_message(0.0, 2.0, 0.6)), steps=1)
        before = node.heights(0.0, 0.0)
        node.run(24)
        assert node.heights(0.0, 0.0) - before == pytest.approx(0.06, abs=0.01)


def test_a_body_of_the_simulation_carries_a_deck_with_maps_updates_and_meshes() -> None:
    with fed({"decks": [LIFT], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(np.zeros((41, 41)), resolution=1.0, origin=(-20.0, -20.0, 0.0)))
        deck = heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile="cage", frame_id="cage")
        node.give("heightmap", deck)
        assert not node.world.terrain.decks  # before its body is there
        node.world.spawn("platform", Box(2.0, 2.0, 0.4), 50.0, BodyState((0.0, 0.0, 0.2)))
        node.run(2)
        assert list(node.world.terrain.decks) == ["cage"]
        assert node.heights([0.0, 4.0], [0.0, 0.0]) == pytest.approx([0.5, 0.0], abs=1e-3)
        [odometry], frame = node.node._outputs._make_odometry(), node.world.terrain.deck("cage").frame(node.world.time)
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "cage")
        at = odometry.pose.pose.position
        assert [at.x, at.y, at.z] == frame.position.tolist()
        update = HeightmapUpdate(tile="cage", x=8, y=8, width=5, height=5, heights=floats(np.full(25, 0.25)))
        node.give("heightmap_update", stamped(node, update, "cage"))
        node.run(120)
        assert node.heights(0.0, 0.0) == pytest.approx(0.75, abs=1e-3)
        vertices, triangles = mesh_parts.sheet(1.0, 4)
        roof = mesh_message(vertices + [0.0, 0.0, 3.0], triangles, tile="cage/roof", frame_id="cage")
        node.give("terrain_mesh", roof)
        assert node.heights(0.0, 0.0) == pytest.approx(3.5, abs=1e-3)
        assert set(node.world.terrain.decks["cage"].tiles) == {"", "roof"}
        node.require_refused("heightmap", [("frame", heightmap_message(FLAT, tile="cage", frame_id="map"))])
        node.give("heightmap", heightmap_message(np.zeros((0, 0)), tile="cage", frame_id="cage"))
        assert set(node.world.terrain.decks["cage"].tiles) == {"roof"}


def test_maps_in_the_frame_of_a_deck_are_its_maps_and_a_reset_keeps_them() -> None:
    with fed({"decks": [FERRY], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, frame_id="ferry/base_link"))
        assert node.world.terrain.empty
        with pytest.raises(InputError, match="not the terrain's frame 'map', nor 'ferry/base_link' of deck 'ferry'"):
            node.node.session.require_frame("ferry")

        def sail(height: float) -> None:
            frame = transform_message(node, "map", "ferry/base_link", (0.0, 0.0, height))
            node.give("/tf", TFMessage(transforms=[frame]), steps=1)

        sail(2.0)
        assert node.heights(0.0, 0.0) == pytest.approx(2.5)
        node.node.reset()
        sail(3.0)
        assert node.heights(0.0, 0.0) == pytest.approx(3.5)


def test_a_body_without_the_link_that_carries_a_deck_hinders_no_call(logged: Logged) -> None:
    with fed({"decks": ["{deck: bed, body: truck, link: trailer}"], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN))
        rover = Path(ROVER).read_text()
        assert node.call("spawn_body", SpawnBody.Request(id="truck", urdf=rover, on_ground=True)).success
        saved = node.call("save_state", SaveState.Request())
        assert saved.success, saved.message
        for service, request in (
            ("restore_state", RestoreState.Request(state=saved.state)), ("start_episode", StartEpisode.Request()),
        ):  # fmt: skip
            answer = node.call(service, request)
            assert answer.success, answer.message
        assert "decks refused: 'truck' has no link 'trailer'" in logged()


def test_an_episode_begins_without_the_soil_of_a_map_that_came_later() -> None:
    with fed({"soil.type": ["dry_sand"], "frame_id": "map"}) as node:
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=(9.0, 0.0, 0.0), tile="east"))
        for _ in range(2):
            node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN))
            assert node.world.ground.soil is not None
            answer = node.call("start_episode", StartEpisode.Request())
            assert answer.success, answer.message
            assert node.world.ground.soil is None and node.world.terrain.tiles.keys() == {"east"}


def test_a_deck_that_came_after_the_start_is_told_of_once_it_comes_again() -> None:
    """An episode begins, and a state of before the deck is restored, without it."""
    with fed({"decks": [BARGE], "frame_id": "map"}) as node:

        def tell() -> str:
            return str(node.node._outputs._diagnostics._terrain()[1])

        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN))
        state = node.call("save_state", SaveState.Request()).state
        node.give("heightmap", heightmap_message(FLAT, resolution=0.25, origin=ORIGIN, tile="barge", frame_id=""))
        for service, request in (
            ("start_episode", StartEpisode.Request()), ("restore_state", RestoreState.Request(state=state)),
        ):  # fmt: skip
            for height in (1.0, 2.0):
                node.give("/barge/odom", stamped(node, odometry_message(10.0, height, 0.0)), steps=1)
                assert node.heights(10.0, 0.0) == pytest.approx(height)
            assert node.call(service, request).success
            assert "barge" not in node.world.terrain.decks
            assert tell() == "no ground yet: the decks barge, of whose frame, topic or body no pose came"
