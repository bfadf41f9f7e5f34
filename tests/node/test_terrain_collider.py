"""The node: over real DDS, in a process of its own; paused, in turns and at its rates; general meshes."""

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import TerrainMeshUpdate
from smartmesh_msgs.srv import RemoveBody, StepPhysics
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.terrain.trimesh import grid_triangles
from smartmesh_ros.tools.testing import Probe, mesh_message, point_message
from tests.node.shared import Fed, box, fed, on_level, show_level_ground, spawn, stamped


def test_bodies_fall_rest_and_report(shared: Probe) -> None:
    show_level_ground(shared)
    spawn(shared, "ball", (3.0, 3.0, 0.6))
    spawn(shared, "box", (2.0, 3.0, 0.6), shape=box(0.2, 0.3, 0.4))
    spawn(shared, "can", (4.0, 3.0, 0.6), shape=SolidPrimitive(type=3, dimensions=[0.4, 0.1]))

    def resting() -> bool:
        heights = [body.pose.position.z for body in shared.latest("body_states").bodies]
        return len(heights) == 3 and np.allclose(heights, 0.2, atol=2e-3)

    shared.wait_for(resting)
    shared.wait_for(lambda: {it.body_id for it in shared.latest("contacts").contacts} == {"ball", "box", "can"})
    timing = shared.latest("timing")
    names = "ingest search collect step publish total lateness"
    assert [stage.stage for stage in timing.stages] == names.split()
    step = timing.stages[3]
    assert step.count > 0
    assert 0.0 < step.p50_us <= step.p99_us <= step.max_us
    bodies = shared.diagnostics("bodies")
    assert (bodies["simulated"], bodies["patches"], bodies["below ground"]) == ("3", "3", "0")
    assert shared.diagnostics("terrain")["samples"] == "3600"
    assert shared.call("remove_body", RemoveBody, id="box").success
    shared.wait_for(lambda: {it.body_id for it in shared.latest("collider_patches").patches} == {"ball", "can"})


def test_a_paused_node_has_no_deadlines_and_a_reset_begins_anew(now: list[float]) -> None:
    """How far steps lead, and which are refused: test_simulation_services.py, test_command.py."""
    with fed({}) as node:
        node.world.spawn("ball", Sphere(0.2), 1.0, BodyState((3.0, 3.0, 5.0)))
        assert node.call("pause", SetBool.Request(data=True)).success
        node.play(now, 1.0, 0.5, lambda: node.step(20))
        now[0] += 10.0
        node.play(now, 1.0, 0.5, lambda: node.step(20))
        assert node.node.pacer.misses == 0
        assert node.call("reset", Trigger.Request()).success
        assert node.world.state("ball").position == (3.0, 3.0, 5.0) and node.world.time == 0.0


def test_many_steps_are_done_in_turns_between_which_the_node_takes_calls_and_signals() -> None:
    with fed({}) as node:
        turns, answers = node.node.session.turns, list[StepPhysics.Response]()
        node.node.pacer.pause(True)
        [served] = [found for found in node.node.services if found.srv_name.endswith("/step")]
        turns.add(served.callback(StepPhysics.Request(steps=100_000), StepPhysics.Response()), answers.append)
        assert node.node.turn() and node.node.turn()
        assert 0.0 < node.world.time < 100_000 / 240.0
        node.node.pacer.pause(False)
        node.node.turn()
        assert answers[0].message == "the physics is running; pause it first; 300 of 100000 steps are done"
        node.node.pacer.pause(True)
        before = node.world.time
        node.step(1050)
        assert node.world.time - before == pytest.approx(1050 / 240.0)


@pytest.mark.parametrize(
    ("topic", "parameter", "rate"),
    [("body_states", "body_states", 20), ("/tf", "tf", 20), ("/clock", "clock", 20), ("timing", "patches", 1)],
)
def test_a_rate_that_is_raised_holds_at_once_and_calls_for_single_steps_put_off_nothing(
    topic: str, parameter: str, rate: int
) -> None:
    """Timing comes once a second."""
    spawned = {"bodies.spawn": ["{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [2.0, 2.0]}"]}
    with on_level({**spawned, f"publish.{parameter}": 0.01}, keep=[topic]) as run:
        run.run(2.0)
        run.set(**{f"publish__{parameter}": 20.0})
        for again in (False, True):
            if again:
                assert run.call("pause", SetBool.Request(data=True)).success
                for _ in range(50):
                    assert run.call("step", StepPhysics.Request(steps=1)).success
                assert run.call("pause", SetBool.Request(data=False)).success
            before = len(run.received(topic))
            run.run(run.time + 2.0)
            assert len(run.received(topic)) - before == pytest.approx(2 * rate, abs=2 if rate > 1 else 1)


TRIANGLES = grid_triangles(20, 30)


def sheet(height: float = 0.0) -> np.ndarray:
    r, c = np.divmod(np.arange(600), 30)
    return np.stack([0.2 * c, 0.2 * r, height + 0.1 * np.sin(0.5 * c)], axis=1)


def update_message(node: Fed, vertices: np.ndarray, indices: list[int] | None = None) -> TerrainMeshUpdate:
    message = TerrainMeshUpdate(vertices=[point_message(v) for v in vertices.tolist()], indices=indices or [])
    return stamped(node, message)


def test_meshes_move_by_updates_and_bad_ones_are_refused() -> None:
    with fed({"terrain.motion": "hold"}) as node:

        def mesh(triangles: Any = TRIANGLES, velocities: int = 0, **more: Any) -> Any:
            made = mesh_message(sheet(), triangles, stamp=node.now(), **more)
            made.velocities = [Vector3()] * velocities
            return made

        node.give("terrain_mesh", mesh())
        meshes = [
            ("length", mesh(triangles=np.zeros((0, 3)))),
            ("length", mesh(velocities=5)),
            ("frame", mesh(frame_id="odom")),
        ]
        updates = [
            ("length", update_message(node, sheet()[:5])),
            ("index", update_message(node, sheet()[:1], [600])),
        ]
        node.require_refused("terrain_mesh", meshes)
        node.require_refused("terrain_mesh_update", updates)
        assert node.world.terrain.tiles[""].version == 0
        node.give("terrain_mesh_update", update_message(node, sheet(1.0)))
        node.give("terrain_mesh_update", update_message(node, sheet(2.0)[5:9], [5, 6, 7, 8]))
        at = [1.2, 2.4], [0.0, 2.4]  # of a vertex that moved twice, and of another
        assert node.heights(*at) == pytest.approx([2.0 + 0.1 * math.sin(3.0), 1.0 + 0.1 * math.sin(6.0)], abs=1e-6)
