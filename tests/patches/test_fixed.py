"""Patches lie on the main mesh and follow bodies and ground."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smartmesh_ros.patches.tracker import PatchTracker

from smartmesh_ros.patches.batch import GridBatch, PatchBatch
from smartmesh_ros.patches.config import PatchConfig, PatchKind
from smartmesh_ros.patches.report.template import patch_template
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

DT = 1.0 / 240.0


def tracker_for(heightmap: HeightMap, radii: list[float], config: PatchConfig | None = None) -> PatchTracker:
    tracker = PatchTracker(Terrain(heightmap), config or PatchConfig(kind="heightfield"))
    tracker.set_bodies(np.array(radii), np.full(len(radii), -1))
    return tracker


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.floats(-3.1, 3.1), st.sampled_from([(3, 3), (5, 9), (40, 30), (200, 150)]))
def test_every_vertex_is_a_sample_of_the_map(seed: int, yaw: float, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=shape).astype(np.float32)
    heightmap = HeightMap(heights, resolution=0.2, origin=(5.0, -3.0, 1.5), yaw=yaw)
    radii = rng.uniform(0.02, 2.0, 20).tolist()
    inside = heightmap.geometry.to_world(rng.uniform(0, shape[0] - 1, 20), rng.uniform(0, shape[1] - 1, 20))
    positions = np.column_stack([inside, np.zeros(20)])
    seen = 0
    for batch in tracker_for(heightmap, radii).update(positions, np.zeros((20, 3)), 0.0, DT):
        vertices = batch.vertices_w().reshape(-1, 3)
        cells = heightmap.geometry.to_grid(vertices[:, :2])
        np.testing.assert_allclose(cells, np.rint(cells), atol=1e-6)
        row, column = np.rint(cells).astype(int).T
        np.testing.assert_allclose(vertices[:, 2], heights[row, column].astype(float) + 1.5, atol=1e-9)
        seen += len(batch.bodies)
    assert seen == 20


@pytest.mark.parametrize("radius", [0.05, 0.2, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("travel", [0.0, 0.1, 0.5])
def test_patches_reach_beyond_the_body_on_every_side(radius: float, travel: float) -> None:
    heightmap = HeightMap(np.zeros((300, 300)), resolution=0.1)
    rng = np.random.default_rng(3)
    positions = np.column_stack([rng.uniform(10, 20, (200, 2)), np.zeros(200)])
    tracker = tracker_for(heightmap, [radius] * 200)
    for batch in tracker.update(positions, np.tile([travel, 0.0, 0.0], (200, 1)), 0.0, DT):
        vertices = batch.vertices_w()
        body = positions[batch.bodies]
        need = radius + travel - 1e-6
        assert np.all(vertices[..., 0].max(axis=1) - body[:, 0] >= need)
        assert np.all(vertices[..., 1].max(axis=1) - body[:, 1] >= need)
        assert np.all(body[:, 0] - vertices[..., 0].min(axis=1) >= need)
        assert np.all(body[:, 1] - vertices[..., 1].min(axis=1) >= need)


@given(
    st.floats(-2, 2), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-3.1, 3.1), st.sampled_from([0.1, 0.3, 0.7])
)
def test_the_twist_of_a_patch_is_that_of_rigidly_moving_ground(
    rise: float, roll: float, pitch: float, yaw: float, radius: float
) -> None:
    heightmap = HeightMap(np.zeros((60, 60)), resolution=0.2, yaw=yaw)
    rows, columns = np.indices((60, 60))
    place = heightmap.geometry.to_world(rows, columns)
    velocities = rise + roll * place[..., 1] - pitch * place[..., 0]
    heightmap.replace(np.zeros((60, 60)), time=0.1, velocities=velocities)
    position = heightmap.geometry.to_world(29.7, 30.2)
    [batch] = tracker_for(heightmap, [radius]).update(np.array([[*position, 0.0]]), np.zeros((1, 3)), 0.1, DT)
    centre = batch.centres_w[0]
    assert batch.linear_w[0, 2] == pytest.approx(rise + roll * centre[1] - pitch * centre[0], abs=1e-3)
    np.testing.assert_allclose(batch.angular_w[0], [roll, pitch, 0.0], atol=1e-3)


def test_patches_do_not_flicker_between_sizes() -> None:
    heightmap = HeightMap(np.zeros((100, 100)), resolution=0.1)
    tracker = tracker_for(heightmap, [0.25])
    sizes = []
    for step in range(60):
        travel = 0.001 if step % 2 else 0.0  # about the border between two sizes
        [batch] = tracker.update(np.array([[5.0, 5.0, 0.2]]), np.array([[travel, 0.0, 0.0]]), 0.0, DT)
        sizes.append(batch.template.size)
    assert len(set(sizes[1:])) == 1
    [batch] = tracker.update(np.array([[5.0, 5.0, 0.2]]), np.array([[0.4, 0.0, 0.0]]), 0.0, DT)
    fast = batch.spacing[0] * batch.template.rings
    [batch] = tracker.update(np.array([[5.0, 5.0, 0.2]]), np.zeros((1, 3)), 0.0, DT)
    assert batch.spacing[0] * batch.template.rings < fast


def test_bodies_off_the_terrain_have_no_patch() -> None:
    heightmap = HeightMap(np.zeros((11, 11)), resolution=1.0)
    positions = np.array([[5.0, 5.0, 0.0], [-0.3, 5.0, 0.0], [-0.6, 5.0, 0.0], [np.nan, 5.0, 0.0], [5.0, 12.0, 0.0]])
    [batch] = tracker_for(heightmap, [0.5] * 5).update(positions, np.zeros((5, 3)), 0.0, DT)
    assert batch.bodies.tolist() == [0, 1]


@pytest.mark.parametrize("rings", [1, 2, 3, 4])
def test_fixed_rings_are_the_reports_collider_size(rings: int) -> None:
    heightmap = HeightMap(np.zeros((50, 50)), resolution=0.1)
    tracker = tracker_for(heightmap, [0.01, 2.0], PatchConfig(rings=rings))
    [batch] = tracker.update(np.array([[2.0, 2.0, 0.0], [3.0, 3.0, 0.0]]), np.zeros((2, 3)), 0.0, DT)
    assert batch.template.size == 2 * rings + 1
    assert batch.stride.tolist() == [1, 1]


@pytest.mark.parametrize("rings", [1, 2, 3, 4])
def test_triangles_cover_the_patch_once_and_face_up(rings: int) -> None:
    template = patch_template(rings)
    points = np.stack([template.columns, template.rows], axis=1).astype(float)
    a, b, c = (points[template.triangles[:, corner]] for corner in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    np.testing.assert_allclose(area, 0.5)
    assert area.sum() == (2 * rings) ** 2
    # Every cell's diagonal joins (r, c) and (r + 1, c + 1), as in the report's Figure 3.
    edges = {
        tuple(sorted((i, j)))
        for corners in template.triangles.tolist()
        for i, j in zip(corners, corners[1:] + corners[:1], strict=True)
    }
    size = template.size
    assert all((i, i + size + 1) in edges for i in range(size * (size - 1) - 1) if i % size != size - 1)


@pytest.mark.parametrize("solid", [True, False])
@pytest.mark.parametrize("kind", ["auto", "heightfield"])
@pytest.mark.parametrize("rings", [0, 3])
def test_a_patch_moves_as_the_ground_under_the_body_does(kind: PatchKind, rings: int, solid: bool) -> None:
    """Where the velocity of the ground is curved, its mean over the patch is another one."""
    rng = np.random.default_rng(4)
    rows, columns = np.indices((60, 60))
    speed = np.sin(0.5 * rows + 1.0) * np.cos(0.4 * columns)
    heightmap = HeightMap(np.zeros((60, 60)), resolution=0.1, yaw=0.7)
    heightmap.replace(0.01 * speed, time=0.01)
    places = heightmap.geometry.to_world(*rng.uniform(10.0, 49.0, (2, 40)))
    positions = np.column_stack([places, heightmap.at(places, 0.01).heights + 0.05])
    tracker = PatchTracker(Terrain(heightmap), PatchConfig(kind=kind, rings=rings))
    tracker.set_bodies(np.full(40, 0.05), np.full(40, -1), np.full(40, solid))
    checked = 0
    tracker.update(positions, np.zeros((40, 3)), 0.01, 0.004)
    for batch in tracker.batches:
        for row, body in enumerate(batch.bodies.tolist()):
            arm = np.append(places[body] - batch.centres_w[row, :2], 0.0)
            rate = batch.linear_w[row, 2] + np.cross(batch.angular_w[row], arm)[2]
            assert rate == pytest.approx(float(heightmap.at([places[body]], 0.01).velocities[0]), abs=1e-3)  # type: ignore[index]
            checked += 1
    assert checked == 40


def by_body(batches: list[PatchBatch]) -> dict[int, FloatArray]:
    return {
        body: points
        for batch in batches
        for body, points in zip(batch.bodies.tolist(), batch.vertices_w(), strict=True)
    }


def test_patches_of_bodies_that_are_not_solid_are_worked_out_when_asked_for() -> None:
    """They are those of fixed extent, as of the last update; where the ground is gone there are none."""
    rng = np.random.default_rng(4)
    heightmap = HeightMap(rng.normal(size=(60, 60)), resolution=0.1)
    terrain, solid = Terrain(heightmap), np.arange(12) % 3 > 0
    fixed, chosen = (PatchTracker(terrain, PatchConfig(kind=kind)) for kind in ("heightfield", "auto"))
    fixed.set_bodies(np.full(12, 0.3), np.full(12, -1))
    chosen.set_bodies(np.full(12, 0.3), np.full(12, -1), solid)
    others = set(np.flatnonzero(~solid).tolist())
    positions, moved = rng.uniform(1.0, 4.0, (12, 3)), np.full((12, 3), 0.05)
    for step in range(3):
        positions = positions + moved
        made = chosen.update(positions, moved, step * DT, DT)
        assert not others & set(by_body(made))
    expected, found = by_body(fixed.update(positions, moved, 2 * DT, DT)), by_body(chosen.batches)
    for body in others:
        np.testing.assert_array_equal(found[body], expected[body])
    chosen.update(positions, moved, 3 * DT, DT)
    terrain.remove("")
    assert not others & set(by_body(chosen.batches))


@pytest.mark.parametrize(("x", "known"), [(5.02, True), (0.22, False)])
def test_a_patch_moved_off_the_edge_claims_no_plane_under_its_body(x: float, *, known: bool) -> None:
    """Its middle, whose facets are taken for those under the body, is elsewhere."""
    heights = (0.1 * (np.arange(101) - 50.0)) ** 2
    tracker = tracker_for(HeightMap(np.tile(heights, (101, 1)), resolution=0.1), [0.3])
    [batch] = tracker.update(np.array([[x, 5.0, 0.0]]), np.zeros((1, 3)), 0.0, DT)
    assert isinstance(batch, GridBatch)
    assert (batch.points_w is not None) == known
