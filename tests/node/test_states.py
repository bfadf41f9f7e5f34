"""Saved states and lockstep."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Twist, Vector3
from rclpy.action import ActionClient
from simulation_interfaces import srv
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import Result
from smartmesh_msgs.srv import RemoveBody, RestoreState, SaveState, SpawnBody, StepPhysics
from std_msgs.msg import String
from std_srvs.srv import SetBool

from smartmesh_ros import BodyState
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import Probe, heightmap_message, pose_message
from tests.node.shared import BALL, Logged, fed, on_level, seconds
from tests.urdfs import HUSKY, ROVER, link, robot

RATE = 240.0
BALL_ABOVE = "{id: ball, shape: sphere, size: [0.2], mass: 1.0, xyz: [3.0, 3.0, 0.3]}"
SHARED = {"publish.clock": 50.0, "simulation_interfaces": True}


@contextmanager
def paused() -> Iterator[Replay]:
    """A paused run with a ball and a robot above soil."""
    rover = f"{{id: rover, urdf: {ROVER}, xyz: [2.0, 2.0, 0.6]}}"
    with on_level({"soil.type": ["clay"], "bodies.spawn": [BALL_ABOVE, rover]}) as run:
        assert run.call("pause", SetBool.Request(data=True)).success
        run.run(0.1)
        yield run


def step(run: Replay, count: int = 1) -> list[tuple[str, BodyState]]:
    """Steps, and returns the bodies then."""
    answer = run.call("step", StepPhysics.Request(steps=count))
    assert answer.success, answer.message
    return [(name, run.world.state(name)) for name in run.world.bodies]


def save(run: Replay, **fields: Any) -> Any:
    answer = run.call("save_state", SaveState.Request(**fields))
    assert answer.success, answer.message
    return answer.state


def restore(run: Replay, **fields: Any) -> None:
    answer = run.call("restore_state", RestoreState.Request(**fields))
    assert answer.success, answer.message


def test_a_state_that_does_not_fit_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    """States that are damaged: tests/world/test_saved_worlds.py."""
    other = tmp_path / "mine.npz"
    other.write_bytes(b"mine")
    with paused() as run:
        state, before = save(run), step(run)
        asked: list[tuple[Any, dict[str, Any], str]] = [
            (RestoreState, {}, "the path of a file, or the bytes"),
            (RestoreState, {"file": str(other)}, "no saved state"),
            (RestoreState, {"file": "/etc/passwd"}, "does not end in .npz"),
            (SaveState, {"file": str(tmp_path / "state.txt")}, "does not end in .npz"),
            (SaveState, {"file": str(other)}, "is no saved state; choose another name"),
        ]
        for kind, fields, words in asked:
            service = "save_state" if kind is SaveState else "restore_state"
            answer = run.call(service, kind.Request(**fields))
            assert not answer.success and words in answer.message
        assert other.read_bytes() == b"mine"
        run.set(physics__gravity=[0.0, 0.0, -1.6], terrain__smoothing=1.0)
        answer = run.call("restore_state", RestoreState.Request(state=state))
        assert not answer.success
        for words in ("physics.gravity ((0.0, 0.0, -9.81) there, (0.0, 0.0, -1.6) here)", "terrain.smoothing (0.0"):
            assert words in answer.message
        assert [(name, run.world.state(name)) for name in run.world.bodies] == before


def test_bodies_of_a_state_without_soil_stand_on_the_soil_of_the_node() -> None:
    with on_level({"bodies.spawn": [BALL_ABOVE]}) as saver, on_level({"soil.type": ["lunar"]}) as run:
        saver.run(1.0)
        run.run(0.1)
        restore(run, state=save(saver))
        run.run(run.time + 1.0)
        assert saver.world.state("ball").position[2] == pytest.approx(0.2, abs=1e-3)
        assert run.world.state("ball").position[2] < 0.197


def test_an_error_that_nobody_expects_is_the_answer_and_the_node_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the first turn of a call, and in a later one."""
    rover = SpawnBody.Request(id="other", urdf=Path(ROVER).read_text(), pose=pose_message((5.0, 5.0, 0.6)))
    with paused() as run:
        for part, service, request in (
            ("world.World.save", "save_state", SaveState.Request()), ("world.World.spawn_robot", "spawn_body", rover),
        ):  # fmt: skip
            monkeypatch.setattr(f"smartmesh_ros.world.{part}", failing)
            answer = run.call(service, request)
            assert not answer.success and answer.message.startswith("ZeroDivisionError: the moon (test_states.py:")
            step(run)


def failing(*_: Any, **__: Any) -> None:
    raise ZeroDivisionError("the moon")


def simulate(probe: Probe, client: ActionClient, steps: int, cancel_after: int | None = None) -> tuple[Any, list[int]]:
    """Asks for steps by the action; returns the wrapped result, and the completed steps that the feedback told."""
    told: list[int] = []

    def note(message: Any) -> None:
        done = message.feedback.completed_steps
        assert done + message.feedback.remaining_steps == steps
        told.append(done)

    sent = client.send_goal_async(SimulateSteps.Goal(steps=steps), feedback_callback=note)
    goal = probe.wait_for(sent.done) and sent.result()
    assert goal.accepted
    if cancel_after is not None:
        probe.wait_for(lambda: told and told[-1] >= cancel_after)
        goal.cancel_goal_async()
    result = goal.get_result_async()
    probe.wait_for(result.done)
    return result.result(), told


def test_the_action_steps_with_feedback_and_can_be_cancelled(shared: Probe) -> None:
    client = ActionClient(shared.node, SimulateSteps, shared.topic("simulate_steps"))
    shared.wait_for(client.server_is_ready)
    assert shared.call("pause", SetBool, data=True).success
    start = seconds(shared.latest("body_states").header.stamp)
    wrapped, told = simulate(shared, client, 40)
    assert wrapped.status == GoalStatus.STATUS_SUCCEEDED
    assert wrapped.result.result.result == Result.RESULT_OK
    shared.wait_for(lambda: told[-1:] == [40])
    assert told == sorted(set(told))
    shared.wait_for(
        lambda: seconds(shared.latest("body_states").header.stamp) == pytest.approx(start + 40 / RATE, abs=1e-4)
    )
    wrapped, told = simulate(shared, client, 10_000_000, cancel_after=5)
    assert wrapped.status == GoalStatus.STATUS_CANCELED
    assert 5 <= max(told) < 10_000_000
    assert "cancelled after" in wrapped.result.result.error_message
    end = shared.latest("body_states").header.stamp
    assert shared.call("pause", SetBool, data=True).success
    assert shared.latest("body_states").header.stamp == end, "no step after the end"
    for count, words in ((0, "ask for 1"), (5, "set STATE_PAUSED")):
        shared.call("pause", SetBool, data=count == 0)
        wrapped, told = simulate(shared, client, count)
        assert wrapped.status == GoalStatus.STATUS_ABORTED
        assert wrapped.result.result.result == Result.RESULT_OPERATION_FAILED
        assert words in wrapped.result.result.error_message
        assert not told
    client.destroy()


def test_tracked_bodies_of_a_state_leave_when_nobody_tracks_them(logged: Logged) -> None:
    with fed({"bodies.timeout": 0.2}) as node:
        node.world.track("hand", 0.3, BodyState((0.0, 0.0, 1.0)))
        state = node.world.state_bytes()
        node.world.remove("hand")
        node.world.restore(state)
        node.node.take_restored()
        assert "hand" in node.node.session.tracking.names
        while "hand" in node.world.bodies:
            node.run(1)
        assert "bodies.timeout = 0.2 s: removed 'hand'" in logged()
        assert np.isfinite(node.world.time)


def test_a_fresh_node_goes_on_with_the_bodies_of_the_state_and_no_others() -> None:
    """The state knows which bodies of the parameters were removed, and which robot is the description's."""
    places = {"a": 1.0, "b": 2.0, "c": 9.0}
    spawned = [f"{{id: {name}, shape: sphere, size: [0.2], mass: 1.0, xy: [{x}, 2.0]}}" for name, x in places.items()]
    parameters = {"bodies.spawn": spawned, "robot.start": ["{id: rover, xy: [4.0, 4.0]}"]}
    small, large = (("heightmap", 0.0, heightmap_message(np.zeros((60, n)))) for n in (60, 120))
    described = [("robot_description", 0.0, String(data=robot(link(name)))) for name in ("base", "chassis")]
    with Replay([small, described[0]], parameters) as saver, Replay([described[0]], parameters) as fresh:
        saver.run(1.0)
        assert [*saver.world.bodies] == ["a", "b", "rover"]
        assert saver.call("remove_body", RemoveBody.Request(id="b")).success
        state = save(saver)
        for run, again in ((saver, True), (fresh, False)):
            if not again:
                restore(run, state=state)
            run.give("heightmap", small[2])
            run.give(*described[0][::2])
            run.run(run.time + 1.0)
            assert [*run.world.bodies] == ["a", "rover"]
            run.give(*large[::2])
            run.run(run.time + 1.0)
            assert [*run.world.bodies] == ["a", "rover", "c"], "it waited for ground"
            run.give(*described[1][::2])
            run.run(run.time + 1.0)
            assert run.world.bodies["rover"].urdf == described[1][2].data
            assert not run.refused


def test_a_fresh_node_drives_on_as_the_one_that_saved_and_one_that_drove_as_the_state_says(tmp_path: Path) -> None:
    """To the bit; from a file, and from bytes in the message. Other worlds: tests/world/test_saved_worlds.py."""
    file = str(tmp_path / "state.npz")
    wheels = "[front_left_wheel, front_right_wheel, rear_left_wheel, rear_right_wheel]"
    parameters = {
        "bodies.spawn": [f"{{id: husky, urdf: {HUSKY}, xy: [3.0, 3.0]}}"],
        "bases": [f"{{body: husky, wheels: {wheels}, linear_acceleration: 1.0}}"],
    }
    with on_level(parameters) as saver, on_level(parameters) as fresh:
        saver.run(1.0)
        fresh.run(1.2)
        rest = save(saver)
        saver.give("cmd_vel/husky", Twist(linear=Vector3(x=0.5)))
        saver.run(1.2)  # it is still becoming faster
        assert not save(saver, file=file)
        restore(fresh, file=file)
        found = []
        for run in (saver, fresh):
            run.run(run.time + 2.0)
            found.append((run.world.time, run.world.base_state("husky"), run.collider.session.bases["husky"].odometry))
        assert found[0] == found[1] and found[0][2].x > 0.05
        saver.give("cmd_vel/husky", Twist(linear=Vector3(x=0.5)))
        saver.run(saver.time + 0.2)
        restore(saver, state=rest)
        saver.run(saver.time + 1.0)
        assert abs(saver.collider.session.bases["husky"].odometry.x) < 1e-3


def test_a_reset_after_restoring_begins_the_scene_of_the_state() -> None:
    """As the node that saved would: bodies with which its scene began stay, at their starts, and spawned ones go."""

    def scene(name: str) -> dict[str, Any]:
        body = f"{{id: {name}, shape: sphere, size: [0.2], mass: 1.0, xyz: [2.0, 2.0, 1.0]}}"
        return {"simulation_interfaces": True, "bodies.spawn": [body]}

    def named(run: Replay) -> dict[str, str]:
        answer = run.call("get_named_poses", srv.GetNamedPoses.Request())
        return {pose.name: str(pose.pose) for pose in answer.poses}

    with on_level(scene("here")) as fresh, on_level(scene("there")) as saver:
        for run in (fresh, saver):
            run.run(0.5)
        extra = SpawnBody.Request(id="extra", shape=BALL, mass=1.0, pose=pose_message((4.0, 2.0, 1.0)))
        assert saver.call("spawn_body", extra).success
        state = save(saver)
        before = save(fresh)
        restore(fresh, state=state)
        assert [*fresh.world.bodies] == ["there", "extra"] and named(fresh) == named(saver)
        for run in (fresh, saver):
            assert run.call("reset_simulation", srv.ResetSimulation.Request()).result.result == Result.RESULT_OK
            assert [*run.world.bodies] == ["there"] and run.world.state("there").position == (2.0, 2.0, 1.0)
        restore(fresh, state=before)
        assert fresh.call("remove_body", RemoveBody.Request(id="here")).success
        fresh.call("reset_simulation", srv.ResetSimulation.Request())
        assert [*fresh.world.bodies] == ["here"], "it is in the parameters"
