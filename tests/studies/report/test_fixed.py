"""Patches of fixed extent, as the report makes them: around the nearest vertex, as large as asked for."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap
from smartmesh_ros.ground.state import BODY_COLUMNS
from studies.report.config import ReportConfig
from studies.report.patches import ChosenPatches, PatchBatch, mesh_twist
from tests.examples import examples

SOLID = ReportConfig(kind="trimesh")  # whose patches have the extent that the body's size asks for


def patches_of(
    ground: HeightMap, radii: list[float], positions: np.ndarray, config: ReportConfig = SOLID, time: float = 0.0
) -> list[PatchBatch]:
    """Patches of balls of ``radii`` (N,) at positions (N, 3) [m], without a physics world."""
    followers: Any = SimpleNamespace(radii=np.array(radii), table={"alive": np.ones(len(radii), bool)})
    states = np.zeros((len(positions), BODY_COLUMNS))
    states[:, :3], states[:, 6] = positions, 1.0
    chosen = ChosenPatches(config, followers)
    chosen.refresh(ground, time, 1.0 / 240.0, states)
    return chosen.batches


@examples(30)
@given(
    st.floats(-2, 2), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-3.1, 3.1), st.sampled_from([0.1, 0.3, 0.7])
)
@pytest.mark.parametrize("config", [SOLID, ReportConfig(rings=2), ReportConfig()])
def test_the_twist_of_a_patch_is_that_of_rigidly_moving_ground(
    config: ReportConfig, rise: float, roll: float, pitch: float, yaw: float, radius: float
) -> None:
    heightmap = HeightMap(np.zeros((60, 60)), resolution=0.2, yaw=yaw)
    place = heightmap.geometry.to_world(*np.indices((60, 60)))
    velocities = rise + roll * place[..., 1] - pitch * place[..., 0]
    heightmap.replace(np.zeros((60, 60)), time=0.1, velocities=velocities)
    position = heightmap.geometry.to_world(29.7, 30.2)
    [batch] = patches_of(heightmap, [radius], np.array([[*position, 0.5 * radius]]), config, 0.1)
    [foot] = batch.feet_w
    np.testing.assert_allclose(foot[:2], position)
    np.testing.assert_allclose(batch.linear_w[0], [0.0, 0.0, rise + roll * foot[1] - pitch * foot[0]], atol=1e-3)
    np.testing.assert_allclose(batch.angular_w[0], [roll, pitch, 0.0], atol=1e-3)


@pytest.mark.parametrize("config", [SOLID, ReportConfig(rings=3), ReportConfig()])
def test_a_patch_moves_as_the_ground_under_the_body_does(config: ReportConfig) -> None:
    """Where the velocity of the ground is curved, its mean over the patch is another one."""
    rng = np.random.default_rng(4)
    rows, columns = np.indices((60, 60))
    speed = np.sin(0.5 * rows + 1.0) * np.cos(0.4 * columns)
    heightmap = HeightMap(np.zeros((60, 60)), resolution=0.1, yaw=0.7)
    heightmap.replace(0.01 * speed, time=0.01)
    places = heightmap.geometry.to_world(*rng.uniform(10.0, 49.0, (2, 40)))
    positions = np.column_stack([places, heightmap.at(places, 0.01).heights + 0.05])
    batches = patches_of(heightmap, [0.05] * 40, positions, config, 0.01)
    feet, linear = (np.concatenate([getattr(batch, name) for batch in batches]) for name in ("feet_w", "linear_w"))
    assert len(feet) == 40
    np.testing.assert_allclose(linear[:, 2], heightmap.at(feet[:, :2], 0.01).velocities, atol=1e-3)


def test_bodies_off_the_terrain_have_no_patch() -> None:
    heightmap = HeightMap(np.zeros((11, 11)), resolution=1.0)
    positions = np.array([[5.0, 5.0, 0.0], [-0.3, 5.0, 0.0], [-0.6, 5.0, 0.0], [np.nan, 5.0, 0.0], [5.0, 12.0, 0.0]])
    [batch] = patches_of(heightmap, [0.5] * 5, positions)
    assert batch.slots.tolist() == [0, 1]


@pytest.mark.parametrize("rings", [1, 2, 3, 4])
def test_fixed_rings_are_the_reports_collider_size(rings: int) -> None:
    rng = np.random.default_rng(0)
    heightmap = HeightMap(rng.normal(scale=0.05, size=(50, 50)), resolution=0.1)
    positions = np.column_stack([rng.uniform(1.0, 3.9, (6, 2)), np.full(6, 1.0)])
    [batch] = patches_of(heightmap, [0.01, 2.0] * 3, positions, ReportConfig(rings=rings))
    side = 2 * rings + 1
    assert batch.shape == (side, side)
    np.testing.assert_allclose(batch.centres_w[:, :2], np.rint(positions[:, :2] / 0.1) * 0.1, atol=1e-9)
    np.testing.assert_allclose(np.ptp(batch.vertices_w[..., :2], axis=1), 0.2 * rings, atol=1e-9)


numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)

PLACES = np.array([[x, y, 0.1 * x * y] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)])


@given(vectors, vectors, vectors)
def test_a_rigid_motion_is_found_wherever_the_body_is(
    linear: np.ndarray, angular: np.ndarray, body: np.ndarray
) -> None:
    found = mesh_twist(PLACES, linear + np.cross(angular, PLACES), body, 1.0)
    np.testing.assert_allclose(found, (linear, angular), atol=1e-6)
