"""General meshes and tiles over real topics."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3
from smartmesh_msgs.msg import ColliderPatch, Heightmap, TerrainMeshUpdate

from smartmesh_ros.terrain.trimesh import grid_triangles
from smartmesh_ros.tools.testing import Probe, Process, heightmap_message, mesh_message, point_message
from tests.node.shared import box, changed, require_refused, set_parameters, spawn

TRIANGLES = grid_triangles(20, 30)


def sheet(height: float = 0.0) -> np.ndarray:
    r, c = np.divmod(np.arange(600), 30)
    return np.stack([0.2 * c, 0.2 * r, height + 0.1 * np.sin(0.5 * c)], axis=1)


def update_message(probe: Probe, vertices: np.ndarray, indices: list[int] | None = None) -> TerrainMeshUpdate:
    message = TerrainMeshUpdate(vertices=[point_message(v) for v in vertices.tolist()], indices=indices or [])
    message.header.stamp, message.header.frame_id = probe.now(), "map"
    return message


def patch_vertices(probe: Probe) -> dict[str, np.ndarray]:
    """Vertices of the newest collider patches by body."""
    return {
        patch.body_id: np.array([(v.x, v.y, v.z) for v in patch.mesh.vertices])
        for patch in probe.latest("collider_patches").patches
    }


def test_patches_follow_a_general_mesh_whose_vertices_move(shared: Probe) -> None:
    with changed(shared, {"search.method": "best_first"}):

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


def test_bodies_ride_a_rising_mesh(shared: Probe) -> None:
    with changed(shared, {"search.method": "ray_cast"}):
        shared.publishers["terrain_mesh"].publish(mesh_message(sheet(), TRIANGLES, stamp=shared.now()))
        spawn(shared, "box", (3, 2, 0.3), shape=box(0.5, 0.5, 0.2))
        level = 0.0

        def risen() -> bool:
            nonlocal level
            level = min(level + 0.02, 0.6)
            shared.publishers["terrain_mesh_update"].publish(update_message(shared, sheet(level)))
            return any(body.pose.position.z > 0.6 for body in shared.latest("body_states").bodies)

        shared.wait_for(risen)


def test_a_mesh_of_several_parts_carries_bodies_on_and_under_its_table(shared: Probe) -> None:
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
    floor, table = (np.column_stack([square, np.full(4, z)]) for z in (0.0, 1.0))
    corners = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    shared.publishers["terrain_mesh"].publish(mesh_message(np.concatenate([floor, table]), corners, stamp=shared.now()))
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "1")
    for name, z in (("on", 1.3), ("under", 0.3)):
        spawn(shared, name, (2, 2, z), shape=box(0.5, 0.5, 0.2))

    def rest() -> bool:
        heights = {body.id: body.pose.position.z for body in shared.latest("body_states").bodies}
        return abs(heights.get("on", 0.0) - 1.1) < 1e-3 and abs(heights.get("under", 0.0) - 0.1) < 1e-3

    shared.wait_for(rest)


def test_methods_that_a_mesh_does_not_allow_are_refused_and_named(
    shared: Probe, shared_node: tuple[Probe, Process]
) -> None:
    sheared = sheet()
    sheared[:, 0] += 4.0 * sheared[:, 1]
    with changed(shared, {"search.method": "best_first"}):
        shared.publishers["terrain_mesh"].publish(mesh_message(sheared, TRIANGLES, stamp=shared.now()))
        key = "refused, terrain_mesh: search_method"
        shared.wait_for(lambda: shared.diagnostics("inputs").get(key) == "1")
        assert "use brute_force, ray_cast" in shared_node[1].output
        assert shared.diagnostics("terrain")["tiles"] == "0"
        assert set_parameters(shared, {"search.method": "brute_force"}).successful
        shared.publishers["terrain_mesh"].publish(mesh_message(sheared, TRIANGLES, stamp=shared.now()))
        shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "1")
        refused = set_parameters(shared, {"search.method": "best_first"})
        assert not refused.successful
        assert "brute_force" in refused.reason
        assert not set_parameters(shared, {"patch.kind": "whole_heightfield"}).successful
        shared.publishers["terrain_mesh"].publish(mesh_message(sheet(), TRIANGLES, stamp=shared.now()))
        shared.wait_for(lambda: set_parameters(shared, {"search.method": "best_first"}).successful)
        folded = sheet()
        folded[100:110, 0] -= 3.0
        shared.publishers["terrain_mesh_update"].publish(update_message(shared, folded))
        shared.wait_for(lambda: shared.diagnostics("inputs").get("refused, terrain_mesh_update: search_method") == "1")


def test_bad_meshes_are_refused_and_the_last_one_stays(shared: Probe) -> None:
    def mesh(vertices: Any = None, triangles: Any = TRIANGLES, **more: Any) -> Any:
        return mesh_message(sheet() if vertices is None else vertices, triangles, stamp=shared.now(), **more)

    def short_velocities() -> Any:
        message = mesh()
        message.velocities = [Vector3()] * 5
        return message

    meshes, updates = shared.publishers["terrain_mesh"], shared.publishers["terrain_mesh_update"]
    meshes.publish(mesh())
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "1")
    cases: list[tuple[Any, str, Callable[[], Any]]] = [
        (meshes, "index", lambda: mesh(triangles=[[0, 1, 600]])),
        (meshes, "non_finite", lambda: mesh(sheet() * np.inf)),
        (meshes, "length", lambda: mesh(triangles=np.zeros((0, 3)))),
        (meshes, "length", short_velocities),
        (meshes, "frame", lambda: mesh(frame_id="odom")),
        (updates, "length", lambda: update_message(shared, sheet()[:5])),
        (updates, "index", lambda: update_message(shared, sheet()[:2], [3, 3])),
        (updates, "index", lambda: update_message(shared, sheet()[:1], [600])),
        (updates, "non_finite", lambda: update_message(shared, sheet()[:1] * np.nan, [1])),
    ]
    require_refused(shared, cases)
    assert shared.diagnostics("terrain")["updates of ''"] == "0"


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_tiles_come_are_crossed_and_go(shared: Probe, gap: float) -> None:
    flat, unknown = np.zeros((51, 51)), "refused, heightmap: unknown_tile"
    before = int(shared.diagnostics("inputs").get(unknown, 0))
    shared.publish_map(flat, resolution=0.2, origin=(-10.0 - gap, -5.0, 0.5), tile="west")
    shared.publish_map(flat, resolution=0.2, origin=(0.0, -5.0, 0.5), tile="east")
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "2")

    def crossing() -> bool:
        shared.publish_bodies({"rover": (-0.05, 0.0, 0.8)}, radius=0.3)
        seen = patch_vertices(shared)
        return len(seen) == 1 and seen["rover"][:, 0].min() < -0.3 and seen["rover"][:, 0].max() > 0.3

    shared.wait_for(crossing)
    assert np.abs(patch_vertices(shared)["rover"][:, 2] - 0.5).max() < 1e-6
    removal = heightmap_message(np.zeros((0, 0)), tile="east", stamp=shared.now())
    assert isinstance(removal, Heightmap)
    shared.publishers["heightmap"].publish(removal)
    shared.wait_for(lambda: shared.diagnostics("terrain")["tiles"] == "1")
    shared.publishers["heightmap"].publish(heightmap_message(np.zeros((0, 0)), tile="north", stamp=shared.now()))
    shared.wait_for(lambda: shared.diagnostics("inputs").get(unknown) == str(before + 1))
