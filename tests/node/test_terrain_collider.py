"""The node over real DDS, in a process of its own: height maps, general meshes, tiles."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import ColliderPatch, Contact, TerrainMeshUpdate
from smartmesh_msgs.srv import RemoveBody, StepPhysics
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker

from smartmesh_ros.terrain.trimesh import grid_triangles
from smartmesh_ros.tools.testing import Probe, assert_on_map, mesh_message, point_message
from tests.node.shared import (
    Fed,
    box,
    changed,
    fed,
    one_round,
    patch_vertices,
    position_of,
    set_parameters,
    show_level_ground,
    spawn,
    stamped,
)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_every_patch_vertex_lies_on_the_published_map_and_goes_with_its_body(shared: Probe, yaw: float) -> None:
    heights = np.random.default_rng(3).normal(size=(80, 60)) * 0.3
    message = shared.publish_map(heights, resolution=0.25, origin=(2.0, -1.0, 0.4), yaw=yaw)
    cos, sin = math.cos(yaw), math.sin(yaw)
    middle = (2.0 + 7.0 * cos - 9.0 * sin, -1.0 + 7.0 * sin + 9.0 * cos)
    bodies = {name: (middle[0] + i, middle[1], 3.0) for i, name in enumerate(("rover", "arm", "dog"))}

    def three_patches() -> bool:
        shared.publish_bodies(bodies, radius=0.3)
        return len(shared.patches()) == 3

    gone: set[int] = set()

    def one_is_gone() -> bool:
        markers = shared.latest("patches").markers
        gone.update(marker.id for marker in markers if marker.action == Marker.DELETE)
        return bool(gone)

    with changed(shared, {"bodies.timeout": 1000.0}):  # no body goes because its poses come late
        shared.wait_for(three_patches)
        last = shared.latest("patches")
        assert {marker.header.frame_id for marker in last.markers} == {"map"}
        for points in shared.patches().values():
            assert len(points) >= 24
            assert_on_map(points, message)
        ids = set(shared.patches())
        one_round(shared)  # no pose of the body comes after its removal
        assert shared.call("remove_body", RemoveBody, id="arm").success
        shared.wait_for(one_is_gone)
        assert len(gone) == 1
        assert set(shared.patches()) == ids - gone


def test_poses_make_bodies_and_a_shorter_array_takes_them_away(shared: Probe) -> None:
    shared.publish_map(np.zeros((50, 50)))
    seen: set[str] = set()

    def patched(count: int) -> bool:
        shared.publish_poses([(2.0 + 0.3 * i, 2.0, 0.1) for i in range(count)])
        seen.clear()
        seen.update(patch_vertices(shared))
        return len(seen) == count

    shared.wait_for(lambda: patched(4))
    assert seen == {"body_0", "body_1", "body_2", "body_3"}

    def touching() -> dict[str, Contact]:  # once they are told again: on a slow machine they may have timed out
        return {contact.body_id: contact for contact in shared.latest("contacts").contacts} if patched(2) else {}

    contacts = shared.wait_for(touching)
    assert contacts["body_0"].depth == pytest.approx(0.15, abs=1e-3)  # the default radius less the height
    assert contacts["body_0"].normal.z == pytest.approx(1.0)


def test_bodies_fall_rest_and_report(shared: Probe) -> None:
    show_level_ground(shared)
    spawn(shared, "ball", (3.0, 3.0, 0.6))
    spawn(shared, "box", (2.0, 3.0, 0.6), shape=box(0.2, 0.3, 0.4))
    spawn(shared, "can", (4.0, 3.0, 0.6), shape=SolidPrimitive(type=3, dimensions=[0.4, 0.1]))

    def resting() -> bool:
        heights = [body.pose.position.z for body in shared.latest("body_states").bodies]
        return len(heights) == 3 and np.allclose(heights, 0.2, atol=2e-3)

    shared.wait_for(resting)

    def carried() -> bool:
        forces = {"ball": 0.0, "box": 0.0, "can": 0.0}
        for contact in shared.latest("contacts").contacts:
            forces[contact.body_id] += contact.normal_force
        return forces == pytest.approx(dict.fromkeys(forces, 9.81), rel=0.02)

    shared.wait_for(carried)
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
    shared.wait_for(lambda: patch_vertices(shared).keys() == {"ball", "can"})


def test_pause_step_and_reset(shared: Probe) -> None:
    shared.publish_map(np.zeros((60, 60)))
    refused = shared.call("step", StepPhysics, steps=1)
    assert not refused.success
    assert "pause" in refused.message
    assert shared.call("pause", SetBool, data=True).success
    spawn(shared, "ball", (3.0, 3.0, 5.0))
    position = partial(position_of, shared, "ball")
    shared.wait_for(lambda: position() == (3.0, 3.0, 5.0))  # states of before may come after the answer
    assert shared.call("step", StepPhysics, steps=24).success
    fallen = 5.0 - 9.81 / 240.0**2 * 24 * 25 / 2  # symplectic Euler: the sum of 1 .. 24 steps of g dt^2
    assert shared.wait_for(lambda: (p := position()) and p[2] < 5.0 and p)[2] == pytest.approx(fallen, abs=1e-6)
    missed = shared.diagnostics("physics")["deadline misses"]
    assert shared.call("step", StepPhysics, steps=20_000).success
    shared.latest("/diagnostics")  # may be of before the steps
    assert shared.diagnostics("physics")["deadline misses"] == missed, "a paused node has no deadlines"
    assert not shared.call("step", StepPhysics, steps=0).success
    assert not shared.call("step", StepPhysics, steps=4_000_000_000).success
    assert shared.call("reset", Trigger).success
    shared.wait_for(lambda: position() == (3.0, 3.0, 5.0))
    assert shared.diagnostics("physics")["paused"] == "True"
    assert shared.call("pause", SetBool, data=False).success
    shared.wait_for(lambda: (p := position()) and p[2] < 0.3)


def test_outputs_keep_their_rates_after_many_calls_for_single_steps(shared: Probe) -> None:
    """Each call publishes all outputs: it does not put off the next ones. Timing comes once a second."""
    shared.call("pause", SetBool, data=True)
    for _ in range(20):
        assert shared.call("step", StepPhysics, steps=1).success
    shared.call("pause", SetBool, data=False)
    timings, diagnostics = shared.received[shared.topic("timing")], shared.received["/diagnostics"]
    shared.latest("/diagnostics")
    before, start = len(timings), len(diagnostics)
    shared.wait_for(lambda: len(diagnostics) > start + 10)  # two seconds
    assert len(timings) > before


def test_parameters_change_at_run_time_as_a_whole_or_not_at_all(shared: Probe) -> None:
    with changed(shared, {"physics.rate": 120.0, "bodies.default_radius": 0.15}):
        shared.publish_map(np.zeros((60, 60)))
        spawn(shared, "ball", (3.0, 3.0, 1000.0))
        assert set_parameters(shared, {"physics.rate": 60.0, "bodies.default_radius": 0.5}).successful
        bad = set_parameters(shared, {"physics.rate": 120.0, "terrain.motion": "jelly"})
        assert not bad.successful
        assert "terrain.motion" in bad.reason
        assert not set_parameters(shared, {"physics.rate": 0.0}).successful
        assert not set_parameters(shared, {"frame_id": "other"}).successful, "read-only"
        shared.latest("timing")
        timing = shared.latest("timing")
        assert timing.stages[3].count == pytest.approx(60.0 * timing.window_s, rel=0.2), "still 60 Hz"


TRIANGLES = grid_triangles(20, 30)


def sheet(height: float = 0.0) -> np.ndarray:
    r, c = np.divmod(np.arange(600), 30)
    return np.stack([0.2 * c, 0.2 * r, height + 0.1 * np.sin(0.5 * c)], axis=1)


def update_message(probe: Probe | Fed, vertices: np.ndarray, indices: list[int] | None = None) -> TerrainMeshUpdate:
    message = TerrainMeshUpdate(vertices=[point_message(v) for v in vertices.tolist()], indices=indices or [])
    return stamped(probe, message)


def test_patches_follow_a_general_mesh_whose_vertices_move(shared: Probe) -> None:

    def tracked(height: float) -> bool:
        shared.publish_poses([(2.0, 2.0, 0.5), (4.0, 1.0, 0.5)])
        seen = patch_vertices(shared)
        everything = sheet(height)
        return len(seen) == 2 and all(
            np.abs(everything[:, None] - mine).max(axis=2).min(axis=0).max() < 1e-9 for mine in seen.values()
        )

    shared.publishers["terrain_mesh"].publish(mesh_message(sheet(), TRIANGLES, stamp=shared.now()))
    shared.wait_for(lambda: tracked(0.0))
    kinds = {patch.kind for patch in shared.latest("collider_patches").patches}
    assert kinds == {ColliderPatch.TRIMESH}
    assert shared.diagnostics("terrain")["size of ''"] == "mesh of 600 vertices and 1102 triangles"
    shared.publishers["terrain_mesh_update"].publish(update_message(shared, sheet(1.0)))
    shared.wait_for(lambda: tracked(1.0))
    shared.publishers["terrain_mesh_update"].publish(update_message(shared, sheet(2.0)[5:9], [5, 6, 7, 8]))
    shared.wait_for(lambda: shared.diagnostics("terrain")["updates of ''"] == "2")
    shared.wait_for(lambda: tracked(1.0))  # vertices elsewhere have not moved


def test_bad_meshes_are_refused_and_the_last_one_stays(domain: int) -> None:
    with fed({}) as node:

        def mesh(vertices: Any = None, triangles: Any = TRIANGLES, velocities: int = 0, **more: Any) -> Any:
            made = mesh_message(sheet() if vertices is None else vertices, triangles, stamp=node.now(), **more)
            made.velocities = [Vector3()] * velocities
            return made

        node.give("terrain_mesh", mesh())
        meshes = [
            ("index", mesh(triangles=[[0, 1, 600]])),
            ("non_finite", mesh(np.full((600, 3), np.inf))),
            ("length", mesh(triangles=np.zeros((0, 3)))),
            ("length", mesh(velocities=5)),
            ("frame", mesh(frame_id="odom")),
        ]
        updates = [
            ("length", update_message(node, sheet()[:5])),
            ("index", update_message(node, sheet()[:2], [3, 3])),
            ("index", update_message(node, sheet()[:1], [600])),
            ("non_finite", update_message(node, sheet()[:1] * np.nan, [1])),
        ]
        node.require_refused("terrain_mesh", meshes)
        node.require_refused("terrain_mesh_update", updates)
        assert node.world.terrain.tiles[""].version == 0


def test_tiles_with_a_gap_come_are_crossed_and_go(shared: Probe) -> None:
    flat, unknown = np.zeros((51, 51)), "refused, heightmap: unknown_tile"
    before = int(shared.diagnostics("inputs").get(unknown, 0))
    shared.publish_map(flat, resolution=0.2, origin=(-10.2, -5.0, 0.5), tile="west")
    shared.publish_map(flat, resolution=0.2, origin=(0.0, -5.0, 0.5), tile="east")
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "2")

    def crossing() -> bool:
        shared.publish_bodies({"rover": (-0.05, 0.0, 0.8)}, radius=0.3)
        seen = patch_vertices(shared)
        return len(seen) == 1 and seen["rover"][:, 0].min() < -0.3 and seen["rover"][:, 0].max() > 0.3

    shared.wait_for(crossing)
    assert np.abs(patch_vertices(shared)["rover"][:, 2] - 0.5).max() < 1e-6
    shared.publish_map(np.zeros((0, 0)), tile="east")
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "1")
    shared.publish_map(np.zeros((0, 0)), tile="north")
    shared.wait_for(lambda: shared.diagnostics("inputs").get(unknown) == str(before + 1))
