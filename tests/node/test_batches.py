"""Many bodies: by one call, all or none; by many calls at once, each of which is answered, in turns; by a parameter."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from smartmesh_msgs.msg import BodySpecification
from smartmesh_msgs.srv import RemoveBodies, RemoveBody, SpawnBodies, SpawnBody

from smartmesh_ros import BodyState, Box, Sphere, World
from smartmesh_ros.node.services.turns import Turns, Work, next_turn
from smartmesh_ros.tools.testing import Probe, heightmap_message, pose_message
from tests.bodies import about_z
from tests.node.shared import BALL, box, fed, on_level, show_map
from tests.node.test_ground_services import MAP, hills

# A busy machine steps a thousand bodies and reads so many messages of them in time, too: answers wait behind both.
SHARED = {"physics.rate": 60.0, "publish.patches": 1.0, "publish.body_states": 1.0}
STANDING: dict[str, Any] = {"on_ground": True, "align": True, "clearance": 0.1}


def specification(index: int, **changes: Any) -> BodySpecification:
    pose = pose_message((1.0 + index % 48, 1.0 + index // 48, 0.2))
    return BodySpecification(**{"id": f"body_{index}", "mass": 1.0, "shape": BALL, "pose": pose, **changes})


def test_what_is_put_onto_the_ground_stands_as_in_a_world() -> None:
    """By the parameter, once there is ground for it, and by a call. Other shapes: tests/world/test_standing.py."""
    entries = [
        "{id: low, shape: sphere, size: [0.2], mass: 1.0, xyz: [2, 2, 9.0]}",
        "{id: high, shape: box, size: [0.2, 0.2, 0.2], xy: [3, 3], above: 1.0, yaw: 0.5}",
        "{id: ball, shape: sphere, size: [0.3], xy: [0.2, 0.1]}",
        "{id: box, shape: box, size: [0.5, 0.4, 0.3], xy: [3, 2], clearance: 0.1, align: true}",
    ]
    called = specification(0, shape=box(0.5, 0.3, 0.2), pose=pose_message((1.0, 1.0, 0.0), 0.3), **STANDING)
    with fed({"bodies.spawn": entries}) as node, World(hills()) as other:
        assert node.world.bodies.keys() == {"low"}
        node.give("heightmap", heightmap_message(**MAP), steps=0)
        while node.node.turn():
            pass
        assert node.call("spawn_bodies", SpawnBodies.Request(bodies=[called])).success
        top = float(hills().at([[3.0, 3.0]], 0.0).heights[0]) + 1.0
        other.spawn("low", Sphere(0.2), 1.0, BodyState((2.0, 2.0, 9.0)))
        other.spawn("high", Box(0.2, 0.2, 0.2), 1.0, BodyState((3.0, 3.0, top), about_z(0.5)))
        other.spawn("ball", Sphere(0.3), 1.0, BodyState((0.2, 0.1, 0.0)), on_ground=True)
        other.spawn("box", Box(0.5, 0.4, 0.3), 1.0, BodyState((3.0, 2.0, 0.0)), **STANDING)
        other.spawn("body_0", Box(0.5, 0.3, 0.2), 1.0, BodyState((1.0, 1.0, 0.0), about_z(0.3)), **STANDING)
        assert {name: node.world.state(name) for name in node.world.bodies} == {
            name: other.state(name) for name in other.bodies
        }


def test_one_bad_body_keeps_all_out_and_every_bad_one_is_named() -> None:
    """As a name that is not there keeps all in."""
    with on_level() as run:
        run.run(0.1)

        def spawned(*bodies: BodySpecification) -> Any:
            return run.call("spawn_bodies", SpawnBodies.Request(bodies=bodies))

        def removed(*names: str) -> Any:
            return run.call("remove_bodies", RemoveBodies.Request(ids=names))

        assert spawned(specification(0)).success
        bad = [
            specification(0),
            specification(2, mass=-1.0),
            specification(3, urdf="/nowhere/robot.urdf"),
            specification(1),  # named twice
        ]
        answer = spawned(specification(1), *bad, specification(4))
        assert not answer.success
        reasons = {failure.id: failure.reason for failure in answer.failures}
        assert reasons.keys() == {body.id for body in bad} and len(answer.failures) == len(bad)
        assert "mass" in reasons["body_2"] and "named 2 times" in reasons["body_1"]
        assert "4 of 6 bodies refused" in answer.message
        assert run.refused == {"spawn_bodies: batch": 1}
        assert spawned(specification(1), specification(4)).success
        answer = removed("body_0", "nobody", "body_1", "body_1")
        assert [failure.id for failure in answer.failures] == ["nobody", "body_1"]
        assert run.world.bodies.keys() == {"body_0", "body_1", "body_4"}
        assert removed("body_0", "body_1").success
        assert run.world.bodies.keys() == {"body_4"}


def require_done(probe: Probe, service: str, kind: Any, requests: list[Any]) -> None:
    """Makes all calls before the first is answered, by a probe that hears nothing else: one that is busy with large
    messages loses answers itself."""
    with Probe("caller") as caller:
        client = caller.client(probe.topic(service), kind)
        futures = [client.call_async(request) for request in requests]
        caller.wait_for(lambda: all(future.done() for future in futures))
        assert all(future.result().success for future in futures)


def test_a_thousand_bodies_come_and_go_by_one_call_and_by_two_hundred_in_flight_each_of_which_is_answered(
    shared: Probe,
) -> None:
    show_map(shared, np.zeros((101, 101)), resolution=0.5)
    bodies = [specification(index) for index in range(1000)]
    few, many, ids = bodies[:200], bodies[200:], [body.id for body in bodies]
    spawns = [SpawnBody.Request(id=body.id, mass=body.mass, shape=body.shape, pose=body.pose) for body in few]
    require_done(shared, "spawn_body", SpawnBody, spawns)
    answer = shared.call("spawn_bodies", SpawnBodies, bodies=many)
    assert (answer.success, answer.message, answer.failures) == (True, "", [])
    states = shared.wait_for(lambda: len(found := shared.latest("body_states").bodies) == 1000 and found)
    assert {state.id for state in states} == {*ids}
    require_done(shared, "remove_body", RemoveBody, [RemoveBody.Request(id=body.id) for body in few])
    assert shared.call("remove_bodies", RemoveBodies, ids=ids[200:990]).success
    shared.wait_for(lambda: shared.diagnostics("bodies")["simulated"] == "10")
    shared.wait_for(lambda: len(shared.patches()) == 10)


@pytest.mark.parametrize("turns", range(3))
def test_a_body_whose_ground_goes_away_while_it_is_put_there_waits_for_the_next(turns: int) -> None:
    """A mapper's first maps have holes here and there."""
    ground = np.zeros((41, 41))
    with fed({"bodies.spawn": ["{id: ball, shape: sphere, size: [0.2], xy: [2.0, 2.0]}"]}) as node:
        for heights in (ground, np.where(np.hypot(*np.mgrid[-20:21, -20:21]) < 10, np.nan, ground)):
            node.give("heightmap", heightmap_message(heights, resolution=0.1), steps=0)
            for _ in range(turns):
                node.node.turn()
        while node.node.turn():
            pass
        assert node.node.refusals.counts.total() == 0
        node.give("heightmap", heightmap_message(ground, resolution=0.1), steps=0)
        while node.node.turn():
            pass
        assert node.world.bodies.keys() == {"ball"}


def test_a_body_whose_edge_is_over_a_hole_is_put_onto_the_next_map_without_one() -> None:
    ground = np.zeros((41, 41))
    with fed({"bodies.spawn": ["{id: box, shape: box, size: [0.6, 0.6, 0.2], xy: [2.0, 2.0]}"]}) as node:
        for heights, bodies in ((np.where(np.arange(41) > 21, np.nan, ground), set()), (ground, {"box"})):
            node.give("heightmap", heightmap_message(heights, resolution=0.1), steps=0)
            while node.node.turn():
                pass
            assert node.world.bodies.keys() == bodies
        assert node.node.refusals.counts.total() == 1


async def work(name: str, turns: int, log: list[str]) -> str:
    for _ in range(turns):
        log.append(name)
        await next_turn()
    return name


@given(st.lists(st.integers(0, 9), max_size=5))
def test_answers_take_turns_and_each_is_sent_once(lengths: list[int]) -> None:
    turns, log, sent = Turns(), [], []
    for index, length in enumerate(lengths):
        turns.add(Work(work(str(index), length, log)), sent.append)
    between = 0
    while turns.advance():
        between += 1
    assert between == sum(length + 1 for length in lengths), "one part of one answer in each turn"
    assert sorted(sent) == [str(index) for index in range(len(lengths))]
    for round_ in range(max(lengths, default=0)):
        wanted = [str(index) for index, length in enumerate(lengths) if length > round_]
        assert log[: len(wanted)] == wanted, "nobody gets two turns while another waits"
        del log[: len(wanted)]
