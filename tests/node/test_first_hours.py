"""What a new user is told: of bodies below, beside and off the ground, and of maps without ground. Of stamps of other
clocks: test_clock.py, test_real_maps.py. Of files that services may not open: test_command.py."""

from typing import Any

import numpy as np
from smartmesh_msgs.msg import BodySpecification, HeightmapUpdate
from smartmesh_msgs.srv import RestoreState, SaveState, SpawnBodies, SpawnBody, StartEpisode
from std_srvs.srv import Trigger

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import floats, heightmap_message, mesh_message, pose_message
from tests.core import mesh_parts
from tests.node.shared import BALL, Logged, fed, on_level, told
from tests.urdfs import ROVER

HOLES = heightmap_message(np.full((30, 30), np.nan))


def spawning(name: str, place: tuple[float, float, float]) -> SpawnBody.Request:
    return SpawnBody.Request(id=name, mass=1.0, shape=BALL, pose=pose_message(place))


def lines(run: Replay, words: str) -> list[str]:
    return [line for line in run.log if words in line]


def test_a_body_that_falls_beside_the_ground_is_named_once_and_removed() -> None:
    outside = ["{id: outside, shape: sphere, size: [0.2], xyz: [-1.0, 3.0, 0.5]}"]
    with on_level({"bodies.spawn": outside}, keep=["/diagnostics"]) as run:
        run.run(3.0)
        assert "fell off the ground: outside at (-1.00, 3.00)" in told(run, "bodies")["message"]
        run.run(7.0)
        assert "lost, outside" in told(run, "bodies") and not run.world.bodies
        messages = [status.message for array in run.received("/diagnostics") for status in array.status]
        assert messages.count("1 lost in the last second") == 1 and "1 refused in the last second" not in messages
        assert lines(run, "'outside' was 100 m below the ground at (-1.00, 3.00")
        [said] = lines(run, "'outside' at (-1.00, 3.00")
        assert "[WARN]" in said and "falls: there is no ground there" in said


def test_a_body_whose_start_no_map_covers_is_named_until_one_does() -> None:
    waits = ["{id: ball, shape: sphere, size: [0.2], xy: [50.0, 0.0]}"]
    with on_level({"bodies.spawn": waits}, keep=["/diagnostics"]) as run:
        run.run(2.0)
        assert told(run, "bodies")["message"] == "no ground yet where they start: ball"
        run.give("heightmap", heightmap_message(np.zeros((30, 30)), origin=(49.0, -1.0, 0.0)))
        run.run(4.0)
        assert "no ground" not in told(run, "bodies")["message"]
        assert run.world.bodies.keys() == {"ball"}


def test_a_body_that_an_output_names_is_told_of_until_it_is_there() -> None:
    """Its topic has no messages until then, whatever the reason is: here the name is another one."""
    with on_level({"height_scans": ["{body: ball, layout: isaac_lab}"]}, keep=["/diagnostics"]) as run:
        for name, x, words in ("bal", 3.0, "no such body: ball of height_scans"), ("ball", 6.0, "2 patches"):
            assert run.call("spawn_body", spawning(name, (x, 5.0, 0.2))).success
            run.run(run.time + 2.0)
            assert told(run, "bodies")["message"] == words


def test_the_log_names_who_cannot_start_at_the_rim_of_the_ground(logged: Logged) -> None:
    """The robot of a description has no entry in bodies.spawn."""
    start = {"robot.description": ROVER, "robot.start": ["{id: tug, xy: [0.0, 0.0], clearance: 0.1}"]}
    with fed(
        {**start, "bodies.spawn": ["{id: wide, shape: box, size: [9, 9, 1], xy: [2, 2], clearance: 0.1}"]}
    ) as node:
        node.give("heightmap", heightmap_message(np.zeros((30, 30))))
        while node.node.turn():
            pass
        said = logged()
        for name in ("tug", "wide"):
            assert node.node.refusals.counts[f"start of {name!r}: no_ground"] == 1
            assert f"start of {name!r} refused: there is no ground at" in said
        assert node.node.initial.waiting.keys() == {"tug", "wide"}


def test_of_lost_bodies_the_last_ones_and_those_of_the_scene_are_known_and_these_come_back_at_a_reset() -> None:
    with fed({"bodies.spawn": ["{id: first, shape: sphere, size: [0.2], xyz: [1.0, 1.0, 0.5]}"]}) as node:
        node.give("heightmap", heightmap_message(np.zeros((30, 30))))
        for number in range(40):
            [body] = node.world.bodies.values()
            node.world.client.resetBasePositionAndOrientation(body.uid, (1e9, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            node.run(2)
            node.world.spawn(f"body {number}", Sphere(0.1), 1.0, BodyState((2.0, 2.0, 0.5)))
        assert node.node.session.lost.keys() == {"first", *(f"body {number}" for number in range(23, 39))}
        diagnostics = node.node._outputs._diagnostics
        assert diagnostics._bodies()[2]["lost"] == 40
        assert diagnostics._inputs()[1] == "0 refused so far"
        node.node.reset()
        node.node.turn()
        assert node.world.bodies.keys() == {"first", "body 39"}


def test_a_body_that_is_spawned_before_or_below_the_ground_is_told_that_it_falls_or_where_it_starts() -> None:
    words = "starts 2.00 m below the ground, which is at z = 0.00 m there, and is put onto it; on_ground: true chooses"
    below: dict[str, Any] = {"mass": 1.0, "shape": BALL, "pose": pose_message((2.0, 2.0, -2.0))}
    with on_level() as run:
        early = run.call("spawn_body", SpawnBody.Request(id="early", mass=1.0, shape=BALL))
        assert early.success and "'early' falls, because there is no ground before the first map" in early.message
        run.run(0.1)

        def spawned(name: str, **fields: Any) -> str:
            answer = run.call("spawn_body", SpawnBody.Request(id=name, **below | fields))
            assert answer.success
            return str(answer.message)

        assert f"'alone' {words}" in spawned("alone")
        bodies = [BodySpecification(id=name, **below) for name in "ab"]
        assert run.call("spawn_bodies", SpawnBodies.Request(bodies=bodies)).message.count(words) == 2
        assert spawned("on", on_ground=True) == spawned("above", pose=pose_message((2.0, 2.0, 1.0))) == ""
        assert len(lines(run, words)) == 3
        vertices, triangles = mesh_parts.sheet(6.0, 2)
        run.give("terrain_mesh", mesh_message(vertices + [0.0, 0.0, 3.0], triangles, tile="roof"))
        assert spawned("under a roof", pose=pose_message((2.0, 2.0, 1.0))) == ""
        run.run(0.2)
        assert run.world.state("alone").position[2] > 0.1


def test_a_reset_tells_which_bodies_the_ground_has_risen_above() -> None:
    words = "'ball' starts 0.50 m below the ground, which is at z = 1.00 m there, and is put onto it; ~/start_episode"
    with on_level({"terrain.motion": "hold"}) as run:
        for name, x, height in ("ball", 2.0, 0.5), ("high", 4.0, 3.0):
            assert run.call("spawn_body", spawning(name, (x, 2.0, height))).success
        run.run(0.1)
        assert run.call("reset", Trigger.Request()).message == "bodies are back where they were spawned"
        run.give("heightmap", heightmap_message(np.ones((101, 101))))
        answer = run.call("reset", Trigger.Request()).message
        assert answer.startswith(f"bodies are back where they were spawned; {words}") and "'high'" not in answer
        assert len(lines(run, words)) == 1
        run.run(run.time + 0.2)
        assert run.world.state("ball").position[2] > 1.1


def test_ground_that_is_all_removed_is_told_and_restored_ground_is_ground() -> None:
    gone = heightmap_message(np.zeros((0, 0)))
    with on_level(keep=["/diagnostics"]) as run:

        def says() -> str:
            run.run(run.time + 4.0)
            return told(run, "terrain")["message"]

        run.give("heightmap", heightmap_message(np.zeros((30, 30)), tile="east"))
        state = run.call("save_state", SaveState.Request()).state
        gone.tile = "east"
        run.give("heightmap", gone)
        assert "the last map is" in says()
        gone.tile = ""
        run.give("heightmap", gone)
        assert says() == "no map any more: the last one was removed"
        assert run.call("start_episode", StartEpisode.Request()).success
        assert "the last map is" in says()
    with Replay([("restore_state", 0.0, RestoreState.Request(state=state))], keep=["/diagnostics"]) as run:
        run.run(4.0)
        assert told(run, "terrain")["message"] == "the ground of a restored state"


def test_a_map_of_holes_is_told_until_there_is_ground_and_again_when_a_region_takes_it() -> None:
    """Once each time in the log."""
    region = HeightmapUpdate(x=5, y=5, width=3, height=3)
    words = "the map has no ground: all its 900 heights are NaN"
    with Replay([("heightmap", 0.0, HOLES)], keep=["/diagnostics"]) as run:

        def says() -> str:
            run.run(run.time + 4.0)
            return told(run, "terrain")["message"]

        assert words in says(), "the map may have been published once"
        run.give("heightmap", HOLES)
        assert words in says() and len(lines(run, words)) == 1
        assert run.call("reset", Trigger.Request()).success
        assert words in says()
        run.give("heightmap", heightmap_message(np.zeros((30, 30))))
        assert "the last map is" in says()
        run.give("heightmap", HOLES)
        for height, expected in [(0.0, "the last map is"), (np.nan, words)]:
            region.heights = floats(np.full(9, height, np.float32))
            run.give("heightmap_update", region)
            assert expected in says()
        assert not run.refused
