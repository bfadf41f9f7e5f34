"""A replay is what the node makes of the messages, and the same each time."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray, TransformStamped
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import BodyDescriptionArray
from smartmesh_msgs.srv import SpawnBody
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, InputError, Soil
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.node.outputs.cdr import bytes_of
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.replay.bag import Messages, Record
from smartmesh_ros.tools.replay.clock import ReplayClock
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.replay.transport import Log
from smartmesh_ros.tools.testing import bags, heightmap_message, pose_message
from tests.node.shared import BALL as SPHERE
from tests.node.shared import Fed, made_with, seconds
from tests.tools.replay.recordings import BEGIN, RECORDINGS, Message, X, digest_of, in_order

ROOT = Path(__file__).parents[3]
Make = Callable[..., Replay]
BALL = "{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], clearance: 0.3}"


def level(time: float = 0.0, height: float = 0.0, **options: Any) -> Message:
    options = {"resolution": 0.5, "origin": (-5.0, -5.0, 0.0), **options}
    return "heightmap", time, heightmap_message(np.full((21, 21), height), **options)


def flat(state: BodyState) -> list[float]:
    return [*state.position, *state.orientation, *state.linear, *state.angular]


def test_recordings_give_the_same_digests_in_other_processes(tmp_path: Path) -> None:
    """Beside each other and other programs, with other hashes of Python's strings; and in this process, from a list."""
    command = [sys.executable, "-m", "tests.tools.replay.recordings"]
    processes = [
        subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, env={**os.environ, "PYTHONHASHSEED": seed})
        for seed in ("1", "2")
    ]
    first, second = (json.loads(process.communicate()[0].split(b"\n{")[-1].join([b"{", b""])) for process in processes)
    assert first == second
    assert first.keys() == RECORDINGS.keys() and len(set(first.values())) == len(first)
    assert first["tracked"] == digest_of("tracked", tmp_path)


@pytest.mark.parametrize("name", ["maps", "tiles"])
def test_the_node_does_the_same(domain: int, replay: Make, name: str) -> None:
    """A paused node that is given each message before the step in which it arrives, and outputs that nobody keeps."""
    parameters, messages = RECORDINGS[name][0], in_order(name)
    begin = messages[0][1]
    arrivals = [(round((time - begin) * 240.0), topic, message) for topic, time, message in messages]
    for _, _, message in arrivals:
        message.header.stamp = stamp_of(0.0)
    run = replay([(topic, step / 240.0, message) for step, topic, message in arrivals], parameters)
    with made_with(TerrainCollider, parameters) as node:
        node.pacer.pause(True)
        takes = {one.topic_name: one.callback for one in node.subscriptions}
        for step in range(240):
            for arrival, topic, message in arrivals:
                if arrival == step:
                    takes[topic](serialize_message(message))
            while node.turn():
                pass
            Fed(node).step(1)
            run.run((step + 1) / 240.0)
        theirs, ours = node.session.world, run.world
        assert theirs.time == ours.time and theirs.bodies.keys() == ours.bodies.keys()
        for body in ours.bodies:
            assert flat(ours.state(body)) == pytest.approx(flat(theirs.state(body)), abs=1e-6), body
        assert run.refused == dict(node.refusals.counts)


def kept_of(replay: Make, name: str, *keep: str) -> Replay:
    """A recording's replay with outputs, which gives what one without gives."""
    alone, kept = (replay(in_order(name), RECORDINGS[name][0], keep=some) for some in ((), keep))
    alone.run(1.2), kept.run(1.2)
    assert alone.digest == kept.digest
    return kept


def test_outputs_change_nothing_and_are_of_the_right_time(replay: Make) -> None:
    kept = kept_of(replay, "robot", "body_states", "timing", "contacts")
    stamps = [seconds(one.header.stamp) for one in kept.received("body_states")]
    assert np.diff(stamps) == pytest.approx(1.0 / 60.0, abs=1e-5)
    assert stamps[0] >= BEGIN and stamps[-1] <= BEGIN + kept.time
    assert kept.received("body_states")[-1].ahead == pytest.approx(1.0 / 240.0)
    for message in kept.received("timing"):  # of this machine there is nothing
        assert [stage.max_us for stage in message.stages] == pytest.approx([0.0] * len(message.stages), abs=1.0)
    assert len(kept.received("contacts")) == pytest.approx(60 * kept.time, abs=2)


def test_prints_in_soils_by_place_come_with_a_replay(replay: Make) -> None:
    kept = kept_of(replay, "soil", "sinkage", "pressed_ground", "scene")
    soil = kept.world.ground.soil
    assert isinstance(soil, Soil) and soil.map.soil is not None
    np.testing.assert_array_equal(soil.map.soil, X > 0.3)
    assert kept.received("scene")
    update = kept.received("pressed_ground")[-1]
    known = soil.map.heights[update.y : update.y + update.height, update.x : update.x + update.width]
    np.testing.assert_allclose(np.reshape(update.heights, (update.height, update.width)), known, atol=1e-3)
    shown = grid_map_raster(kept.received("sinkage")[-1], RasterConfig(layer="sinkage")).heights
    assert 0.0 < shown.max() <= soil.sinkage().max() + 1e-6


def test_calls_come_when_they_were_recorded_once(replay: Make, tmp_path: Path) -> None:
    """Also if client and server recorded them; answers do nothing, and a call without its contents is refused. Calls of
    a test are answered at once."""
    ball = SpawnBody.Request(id="ball", shape=SPHERE, mass=1.0, pose=pose_message((0.0, 0.0, 1.0)))
    server, client, answer, empty = (SpawnBody.Event(request=[ball]) for _ in range(4))
    server.info.event_type, client.info.event_type = server.info.REQUEST_RECEIVED, client.info.REQUEST_SENT
    answer.info.event_type, empty.info.event_type = answer.info.RESPONSE_SENT, empty.info.REQUEST_RECEIVED
    empty.request = []
    topic = "/terrain_collider/spawn_body/_service_event"
    events = [(topic, 0.1, client), (topic, 0.2, server), (topic, 0.3, answer), (topic, 0.4, empty)]
    bags.write(tmp_path / "bag", [("/terrain_collider/heightmap", *level()[1:]), *events], "sqlite3")
    run = replay(tmp_path / "bag")
    run.run(0.15)
    assert not run.world.bodies
    run.run()
    fallen = 0.5 * 9.81 * 0.2**2
    assert run.world.state("ball").position[2] == pytest.approx(1.0 - fallen, abs=0.01)
    assert run.refused == {f"{topic}: content": 1}
    assert run.call("pause", SetBool.Request(data=True)).message == "paused"
    before = run.world.time
    run.run(run.time + 0.5)
    assert run.world.time == before
    only_client = replay([level(), (topic, 0.1, client), (topic, 0.3, answer)])
    only_client.run()
    assert list(only_client.world.bodies) == ["ball"]


def test_clock_rules_if_it_is_asked_to(replay: Make) -> None:
    """Steps are those that messages of /clock release, here at half speed and with a jump back."""
    times = [0.05 * k for k in range(20)]
    clock = [("/clock", time, Clock(clock=stamp_of(10.0 + 0.5 * time - 5.0 * (time > 0.7)))) for time in times]
    run = replay([level(), *clock], {"use_sim_time": True, "bodies.spawn": [BALL]})
    run.run(0.5)
    assert run.world.time == pytest.approx(0.25, abs=0.01)
    run.run()
    assert run.clock.stamp_now() == pytest.approx(5.475)
    assert run.world.time == pytest.approx(0.35 + 0.1, abs=0.02)
    without = replay([level()], {"use_sim_time": True})
    without.run(0.5)
    assert without.world.time == pytest.approx(0.5)  # nobody else has a clock


def test_latched_messages_wait_for_whoever_asks_late(replay: Make) -> None:
    """Static transforms, which the collider asks for at the first pose in another frame: recorded, or given by a
    test."""
    messages = in_order("grid_maps")
    given = replay([message for message in messages if message[0] != "/tf_static"], RECORDINGS["grid_maps"][0])
    given.give("/tf_static", messages[0][2])
    for run in (replay(messages, RECORDINGS["grid_maps"][0]), given):
        run.run(0.5)
        assert run.refused == {"/odom: frame": 1}
        assert run.world.state("rover").position[0] == pytest.approx(0.5 * 0.45 - 0.5 + 0.25, abs=0.03)


def test_own_frames_come_back_as_over_dds(replay: Make) -> None:
    """A body must not follow a frame of the node itself."""
    parameters = {"bodies.spawn": [BALL], "publish.tf": 20.0, "bodies.frames": ["shadow=ball"]}
    run = replay([level()], parameters, keep="/tf")
    run.run(2.5)
    assert "shadow" not in run.world.bodies and "bodies.frames: own_topic" in run.refused
    assert {one.child_frame_id for message in run.received("/tf") for one in message.transforms} == {"ball"}


def test_bodies_of_a_recorded_peer_are_met(replay: Make) -> None:
    """Which a node finds by itself: a peer's ball stands where a ball of this node falls."""
    peer = replay([level()], {"bodies.spawn": [BALL.replace("id: ball", "id: theirs")]}, keep=["body_states"])
    peer.run(1.5)
    said = peer.received("body_states")
    states = [("/other/terrain_collider/body_states", 0.01 * k, one) for k, one in enumerate(said)]
    for _, _, message in states:
        message.header.stamp, message.bodies = stamp_of(0.0), said[-1].bodies
    for peers in (["auto"], ["/other/terrain_collider"]):
        run = replay([level(), *states], {"bodies.spawn": [BALL], "bodies.peers": peers})
        run.run(0.8)
        x, y, z = run.world.state("ball").position
        assert z > 0.45 or np.hypot(x, y) > 0.05, "it stands on the peer's ball, or has rolled off it"


def test_parameters_that_changed_while_recording_change_again(replay: Make) -> None:
    run = replay(in_order("calls"), {"bodies.timeout": 2.0})
    run.run(0.5)
    assert run.world.config.physics.gravity == (0.0, 1.0, -9.0)
    run.set(physics__rate=120.0)
    assert run.world.dt == pytest.approx(1.0 / 120.0)
    with pytest.raises(InputError, match=r"physics\.rate"):
        run.set(physics__rate=-1.0)


def test_a_place_of_the_code_is_not_logged_too_often() -> None:
    clock, said = ReplayClock(0.0, simulated=False), list[str]()
    log = Log(clock, said.append)
    for clock.elapsed in (0.0, 1.0, 6.0):
        log.warning("here", throttle_duration_sec=5.0)
        log.error("there", throttle_duration_sec=5.0)
    here, there = "[WARN] [{:.3f} s] here", "[ERROR] [{:.3f} s] there"
    assert said == [text.format(time) for time in (0.0, 6.0) for text in (here, there)]


class CutOff(Messages):
    """A recording of which all but the maps is cut off."""

    def records(self, topics: Collection[str]) -> Iterator[Record]:
        for one in super().records(topics):
            yield one if one.topic.endswith("heightmap") else one._replace(data=one.data[:6])


def test_messages_that_are_cut_off_are_refused_one_by_one(replay: Make) -> None:
    others = [("/clock", 0.1, Clock()), ("/parameter_events", 0.2, ParameterEvent()), ("body_poses", 0.3, PoseArray())]
    run = replay(CutOff([level(), *others], "/terrain_collider"), {"use_sim_time": True})
    run.run()
    assert run.refused == {f"{topic}: malformed": 1 for topic, *_ in others}


@pytest.mark.parametrize(
    ("message", "words"),
    [
        *(((topic, 0.0, TFMessage(transforms=[TransformStamped()])),
           f"{topic} has tf2_msgs/msg/TFMessage, and must have {kind}") for topic, kind in (
            ("heightmap", "smartmesh_msgs/msg/Heightmap"), ("/clock", "rosgraph_msgs/msg/Clock"),
            ("/parameter_events", "rcl_interfaces/msg/ParameterEvent"),
            ("spawn_body/_service_event", "smartmesh_msgs/srv/SpawnBody_Event"))),
        (("spawn_body", 0.0, SetBool.Request()), "has std_srvs/srv/SetBool_Event, and must have smartmesh_msgs/srv/"),
        (("pause", 0.0, Clock()), "pause is a service: it takes std_srvs/srv/SetBool_Request, and was given a ros"),
        (("pause", 0.0, SetBool.Response()), "pause was given a SetBool_Response; it must be a message or the request"),
        (("pause", 0.0, {"data": True}), "pause was given a dict; it must be a message or the request of a service"),
        (("pause", float("nan"), SetBool.Request()), "the time of /terrain_collider/pause is nan; it must be a number"),
        (("hightmap", 0.0, level()[2]), "has no input or service hightmap; did you mean 'heightmap'"),
        (("puse", 0.0, SetBool.Request()), "/terrain_collider has no input or service puse; did you mean 'pause'"),
        (("/puse", 0.0, SetBool.Request()), "/terrain_collider has no input or service /puse; did you mean 'pause'"),
    ],
)  # fmt: skip
def test_a_message_of_a_list_that_nothing_takes_is_refused(replay: Make, message: Message, words: str) -> None:
    """What else is refused: test_command.py."""
    with pytest.raises(InputError, match=re.escape(words)):
        replay([level(), message])


def test_what_a_run_has_not_is_named_with_what_would_be_right(replay: Make) -> None:
    parameters = {"publish": {"tf": 50.0}, "physics": {"rate": 480.0}, "use_sim_time": False}  # in groups as in a file
    run = replay([level()], parameters, keep=["contacts", "/tf", "/clock"])

    def refuses(words: str, action: Callable[[], Any]) -> None:
        with pytest.raises(InputError, match=re.escape(words)):
            action()

    refuses("no output contact; did you mean 'contacts'", lambda: replay([level()], keep="contact"))
    refuses("'physics.rat' is unknown; did you mean", lambda: replay([level()], {"physics.rat": 480.0}))
    refuses("'physics.rat' is unknown; did you mean", lambda: replay([level()], {"physics": {"rat": 480.0}}))
    refuses("'physics.rat' is unknown; did you mean", lambda: run.set(physics__rat=480.0))
    refuses("terrain.input is fixed after the start", lambda: run.set(terrain__input="image"))
    refuses("no input hightmap; did you mean 'heightmap'", lambda: run.give("hightmap", level()[2]))
    refuses("no input contacts; it has body_poses, heightmap, ", lambda: run.give("contacts", level()[2]))
    refuses("takes smartmesh_msgs/msg/Heightmap, and was given a Clock", lambda: run.give("heightmap", Clock()))
    refuses("no service puse; did you mean 'pause'", lambda: run.call("puse", SetBool.Request()))
    refuses("pause takes std_srvs/srv/SetBool_Request, and was given a Clock", lambda: run.call("pause", Clock()))
    refuses("joint_states is not kept; name it in keep=['joint_states']", lambda: run.received("joint_states"))
    refuses("until is nan; it must be a number of seconds", lambda: run.run(float("nan")))
    run.run(0.1)
    assert not run.refused and run.world.dt == pytest.approx(1.0 / 480.0)


def test_bytes_without_chance_are_those_of_the_message(replay: Make) -> None:
    """What rmw serialises has padding that was never written, and differs from run to run."""
    keep = ("joint_states", "odometry", "contact_wrenches", "body_descriptions", "timing", "/diagnostics")
    run = replay(in_order("robot"), RECORDINGS["robot"][0], keep=keep)
    run.run()
    for topic in keep:
        message = run.received(topic)[-1]
        data = bytes_of(message)
        assert deserialize_message(data, type(message)) == message, topic
        assert bytes_of(deserialize_message(data, type(message))) == data
    assert isinstance(run.received("body_descriptions")[0], BodyDescriptionArray)
