"""A body gets as much ground as it needs: what is left out lies within the tolerance where the body can touch it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch
from smartmesh_ros.patches.choice import Choice, choose
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.tracker import PatchTracker
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

DT = 1.0 / 240.0
SIZE = 80


def terrain_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    rows, columns = np.indices((SIZE, SIZE)).astype(float)
    if kind == "flat":
        return np.zeros((SIZE, SIZE))
    if kind == "slope":
        return 0.05 * rows - 0.08 * columns
    if kind == "steps":
        return 0.15 * np.floor(rows / 7.0) + 0.002 * columns
    if kind == "noise":
        return np.asarray(rng.normal(scale=0.02, size=(SIZE, SIZE)))
    waves = 0.4 * np.sin(rng.uniform(0.02, 0.4) * rows + 1.0) * np.cos(rng.uniform(0.02, 0.4) * columns)
    if kind == "holes":
        waves[rng.random((SIZE, SIZE)) < 0.02] = np.nan
    return np.asarray(waves)


TERRAINS = ("flat", "slope", "steps", "noise", "waves", "holes")


def ball_points(centre: np.ndarray, radius: float, rng: np.random.Generator) -> np.ndarray:
    """Points below a body, horizontally (500, 2)."""
    angle, distance = rng.uniform(-np.pi, np.pi, 500), radius * np.sqrt(rng.uniform(0.0, 1.0, 500))
    return centre[:2] + np.column_stack([distance * np.cos(angle), distance * np.sin(angle)])


def surface_of(batch: PatchBatch, row: int, points: np.ndarray) -> np.ndarray:
    """Heights of a patch's collider at points (n, 2)."""
    if isinstance(batch, PlaneBatch):
        normal = batch.normals_w[row]
        return np.asarray(batch.points_w[row, 2] - (points - batch.points_w[row, :2]) @ normal[:2] / normal[2])
    assert isinstance(batch, GridBatch)
    geometry, side = batch.heightmap.geometry, batch.template.size
    first = batch.vertices_w()[row, 0]
    patch = HeightMap(
        batch.heights_w[row].reshape(side, side), resolution=float(batch.spacing[row]), origin=(*first[:2], 0.0),
        yaw=geometry.yaw,
    )  # fmt: skip
    return patch.at(points, 0.0).heights


def check(heightmap: HeightMap, batches: list[PatchBatch], centres: np.ndarray, radii: np.ndarray, config: PatchConfig,
          rng: np.random.Generator, time: float) -> int:  # fmt: skip
    """Whether bodies have what they need; how many have a patch."""
    served = set()
    for batch in batches:
        for row, body in enumerate(batch.bodies.tolist()):
            served.add(body)
            points = ball_points(centres[body], radii[body], rng)
            ground, collider = heightmap.at(points, time).heights, surface_of(batch, row, points)
            reach = radii[body] ** 2 - np.sum((points - centres[body, :2]) ** 2, axis=1)
            touched = (ground - centres[body, 2]) ** 2 <= reach
            touched |= (collider - centres[body, 2]) ** 2 <= reach
            bound = float(batch.deviation[row])
            if isinstance(batch, PlaneBatch):
                assert bound <= config.tolerance
                assert not np.isnan(ground[touched]).any(), "a plane over a hole"
            if np.isfinite(bound):  # not near the edge of the map, nor beside holes under fast, large bodies
                # Float32 heights of the map, float64 of the plane.
                assert np.all(np.abs(ground - collider)[touched & ~np.isnan(ground)] <= bound + 1e-6)
    for body in set(range(len(radii))) - served:
        points = ball_points(centres[body], radii[body], rng)
        ground = heightmap.at(points, time).heights
        reach = radii[body] ** 2 - np.sum((points - centres[body, :2]) ** 2, axis=1)
        assert not ((ground - centres[body, 2]) ** 2 <= reach).any(), "no patch, but ground within reach"
    return len(served)


def bodies_near(heightmap: HeightMap, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    geometry = heightmap.geometry
    radii = geometry.resolution * np.exp(rng.uniform(np.log(0.2), np.log(12.0), count))
    place = geometry.to_world(rng.uniform(0.0, SIZE - 1.0, count), rng.uniform(0.0, SIZE - 1.0, count))
    height = np.nan_to_num(heightmap.at(place, 0.0).heights) + radii * rng.choice([0.8, 0.99, 1.0, 1.01, 1.3], count)
    return np.column_stack([place, height]), radii


@settings(max_examples=60, deadline=None, report_multiple_bugs=False)
@given(st.integers(0, 10**6), st.sampled_from(TERRAINS), st.sampled_from([0.0005, 0.002, 0.02]), st.floats(-3.0, 3.0))
def test_what_is_left_out_lies_within_the_bound(seed: int, kind: str, tolerance: float, yaw: float) -> None:
    rng = np.random.default_rng(seed)
    heightmap = HeightMap(terrain_of(kind, rng), resolution=0.1, origin=(3.0, -2.0, 0.5), yaw=yaw)
    centres, radii = bodies_near(heightmap, 30, rng)
    config = PatchConfig(tolerance=tolerance)
    tracker = PatchTracker(Terrain(heightmap), config)
    tracker.set_bodies(radii, np.full(30, -1))
    batches = tracker.update(centres, np.zeros((30, 3)), 0.0, DT)
    assert check(heightmap, batches, centres, radii, config, rng, 0.0)


@settings(max_examples=30, deadline=None, report_multiple_bugs=False)
@given(st.integers(0, 10**6), st.sampled_from(TERRAINS), st.sampled_from([0.1, 0.02]))
def test_the_bound_holds_while_bodies_move_over_ground_at_rest(seed: int, kind: str, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    heightmap = HeightMap(terrain_of(kind, rng), resolution=resolution)
    centres, radii = bodies_near(heightmap, 12, rng)
    speeds = rng.normal(size=(12, 3)) * [1.0, 1.0, 0.1] * rng.choice([0.1, 1.0, 3.0], (12, 1))
    config = PatchConfig()
    tracker = PatchTracker(Terrain(heightmap), config)
    tracker.set_bodies(radii, np.full(12, -1))
    for step in range(60):
        batches = tracker.update(centres, speeds * DT, step * DT, DT)
        check(heightmap, batches, centres, radii, config, rng, 0.0)
        centres = centres + speeds * DT


@settings(max_examples=30, deadline=None, report_multiple_bugs=False)
@given(st.integers(0, 10**6), st.sampled_from(TERRAINS), st.sampled_from([0.1, 0.02]), st.sampled_from([1, 2, 3]))
def test_the_bound_holds_until_the_next_look(seed: int, kind: str, resolution: float, parts: int) -> None:
    """Bodies move, the ground moves on between maps, and new maps come, each as so many regions."""
    rng = np.random.default_rng(seed)
    shape = terrain_of(kind, rng)
    rise = 0.5 * np.sin(np.indices((SIZE, SIZE)).sum(axis=0) / 9.0)
    heightmap = HeightMap(shape, resolution=resolution)
    heightmap.replace(shape + 0.03 * rise, time=0.03)
    centres, radii = bodies_near(heightmap, 12, rng)
    speeds = rng.normal(size=(12, 3)) * [1.0, 1.0, 0.3] * rng.choice([0.0, 0.1, 1.0, 5.0], (12, 1))
    config = PatchConfig()
    tracker = PatchTracker(Terrain(heightmap), config)
    tracker.set_bodies(radii, np.full(12, -1))
    time, maps = 0.03, 1
    for _ in range(24):
        if time >= 0.03 * (maps + 1):
            maps += 1
            new = shape + 0.03 * maps * rise
            for part in np.split(np.arange(SIZE), np.sort(rng.integers(1, SIZE, parts - 1))):
                if part.size:
                    heightmap.update_region(0, int(part[0]), new[:, part], time=0.03 * maps)
        batches = tracker.update(centres, speeds * DT, time, DT)
        check(heightmap, batches, centres, radii, config, rng, time)
        centres = centres + speeds * DT
        time += DT


def test_flat_ground_is_a_plane_and_the_air_is_nothing() -> None:
    heightmap = HeightMap(np.zeros((SIZE, SIZE)), resolution=0.1)
    radii = np.array([0.02, 0.3, 1.5, 0.3])
    centres = np.array([[3.0, 3.0, 0.02], [2.0, 3.0, 0.3], [3.0, 2.5, 1.5], [3.0, 3.0, 2.0]])
    tracker = PatchTracker(Terrain(heightmap), PatchConfig())
    tracker.set_bodies(radii, np.full(4, -1))
    [batch] = tracker.update(centres, np.zeros((4, 3)), 0.0, DT)
    assert batch.kind == "plane"
    assert batch.bodies.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(batch.deviation, 0.0)


def test_coarser_terrain_gets_a_coarser_patch() -> None:
    """A large body on gently curved ground needs few samples, on rough ground many."""
    rows, columns = np.indices((SIZE, SIZE)) * 0.1
    samples = []
    for height in (0.02 * np.sin(rows + columns), np.random.default_rng(0).normal(scale=0.01, size=(SIZE, SIZE))):
        tracker = PatchTracker(Terrain(HeightMap(height, resolution=0.1)), PatchConfig(tolerance=0.002))
        tracker.set_bodies(np.array([1.0]), np.array([-1]))
        [batch] = tracker.update(np.array([[3.0, 3.0, 0.8]]), np.zeros((1, 3)), 0.0, DT)
        assert batch.kind == "heightfield"
        samples.append(batch.template.size)
        assert batch.deviation[0] <= 0.002
    assert samples[0] < samples[1]


@pytest.mark.parametrize("amplitude", [0.001, 0.003, 0.01])
def test_a_resting_body_does_not_change_back_and_forth(amplitude: float) -> None:
    rng = np.random.default_rng(1)
    shape = 0.2 * terrain_of("waves", rng)
    heightmap = HeightMap(shape, resolution=0.1)
    centres, radii = bodies_near(heightmap, 40, rng)
    step_x, step_y = np.array([1e-3, 0.0]), np.array([0.0, 1e-3])
    height = heightmap.at(centres[:, :2], 0.0).heights
    slopes = [(heightmap.at(centres[:, :2] + step, 0.0).heights - height) / 1e-3 for step in (step_x, step_y)]
    centres[:, 2] = height + radii * np.sqrt(1.0 + np.square(slopes).sum(axis=0))
    tracker = PatchTracker(Terrain(heightmap), PatchConfig(tolerance=0.002))
    tracker.set_bodies(radii, np.full(40, -1))
    changes, before = 0, {}
    for step in range(60):
        trembling = centres + rng.uniform(-1.0, 1.0, centres.shape) * 2e-4 * [1.0, 1.0, 0.1]
        heightmap.replace(shape * (1.0 + amplitude * np.sin(step)), time=10.0 * step)
        has = {}
        for batch in tracker.update(trembling, np.zeros((40, 3)), 10.0 * step, DT):
            has.update(dict.fromkeys(batch.bodies.tolist(), (batch.kind, batch.template.size)))
        changes += sum(has.get(body) != before.get(body) for body in range(40)) if before else 0
        before = has
    assert changes <= 0.02 * 40 * 60


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many bodies each look was for."""
    found: list[int] = []

    def counted(*arguments: Any) -> Choice:
        choice = choose(*arguments)
        found.append(len(choice.state))
        return choice

    monkeypatch.setattr("smartmesh_ros.patches.looks.choose", counted)
    return found


def test_on_rough_ground_at_rest_a_rolling_body_is_looked_at_now_and_then(looks: list[int]) -> None:
    heightmap = HeightMap(np.random.default_rng(3).uniform(-0.02, 0.02, (SIZE, SIZE)), resolution=0.1)
    tracker, rng = PatchTracker(Terrain(heightmap), PatchConfig()), np.random.default_rng(4)
    tracker.set_bodies(np.array([0.2]), np.array([-1]))
    travelled = np.linspace(1.0, 5.0, 960)
    for step, x in enumerate(travelled):
        centres = np.array([[x, 0.5 * x + 1.0, 0.2]])
        batches = tracker.update(centres, np.array([[x - travelled[step - 1], 0.0, 0.0]]), step * DT, DT)
        assert check(heightmap, batches, centres, np.array([0.2]), PatchConfig(), rng, 0.0) == 1
    assert len(looks) <= 4.0 / 0.1


def test_on_lively_ground_bodies_have_what_they_touch_and_are_seldom_looked_at(looks: list[int]) -> None:
    rows, columns = np.indices((SIZE, SIZE)) * 0.25

    def ground(time: float) -> np.ndarray:
        return np.asarray(0.3 * np.sin(0.8 * rows + 0.6 * columns + 4.0 * time))

    heightmap, rng = HeightMap(ground(0.0), resolution=0.25), np.random.default_rng(5)
    tracker, radii = PatchTracker(Terrain(heightmap), PatchConfig()), np.full(12, 0.2)
    tracker.set_bodies(radii, np.full(12, -1))
    start, speed = rng.uniform(5.0, 12.0, (12, 2)), rng.uniform(-1.5, 1.5, (12, 2))
    hops = np.where(np.arange(12) < 3, 0.15, 0.0)  # some leave the ground and come back
    before = np.full((12, 3), np.nan)
    for step in range(360):
        time = step * DT
        if step:
            heightmap.replace(ground(time), time=time)
        place = start + speed * time
        height = heightmap.at(place, time).heights + 0.98 * radii + hops * np.abs(np.sin(6.0 * time))
        centres = np.column_stack([place, height])
        moved = np.nan_to_num(centres - before)
        before = centres
        check(heightmap, tracker.update(centres, moved, time, DT), centres, radii, PatchConfig(), rng, time)
    assert len(looks) <= 90


@pytest.mark.parametrize("frequency", [0.0, 4.0])
def test_thrown_bodies_are_looked_at_closely_when_they_come_down(looks: list[int], frequency: float) -> None:
    rows, columns = np.indices((SIZE, SIZE)) * 0.25

    def ground(time: float) -> np.ndarray:
        return np.asarray(0.2 * np.sin(0.8 * rows + 0.6 * columns + frequency * time))

    heightmap, rng = HeightMap(ground(0.0), resolution=0.25), np.random.default_rng(6)
    tracker, radii = PatchTracker(Terrain(heightmap), PatchConfig()), np.full(12, 0.2)
    tracker.set_bodies(radii, np.full(12, -1))
    start, speed = rng.uniform(5.0, 12.0, (12, 2)), rng.uniform(-3.0, 3.0, (12, 2))
    before = np.full((12, 3), np.nan)
    for step in range(240):
        time = step * DT
        if step and frequency:
            heightmap.replace(ground(time), time=time)
        flight = 4.9 * time * (0.98 - time)  # a second, a metre high
        place = start + speed * time
        centres = np.column_stack([place, np.maximum(0.6 + flight, heightmap.at(place, time).heights + 0.15)])
        moved, before = np.nan_to_num(centres - before), centres
        check(heightmap, tracker.update(centres, moved, time, DT), centres, radii, PatchConfig(), rng, time)
    assert 0 < len(looks) <= 40


def test_who_crosses_rough_ground_in_a_hurry_gets_what_it_may_touch_unlooked(looks: list[int]) -> None:
    heightmap = HeightMap(np.random.default_rng(7).uniform(-0.02, 0.02, (200, SIZE)), resolution=0.1)
    tracker, rng = PatchTracker(Terrain(heightmap), PatchConfig()), np.random.default_rng(8)
    tracker.set_bodies(np.full(4, 0.15), np.full(4, -1))
    travelled = np.linspace(1.0, 7.0, 240)  # 6 m/s
    for step, x in enumerate(travelled):
        centres = np.column_stack([np.full(4, x), 2.0 + 4.0 * np.arange(4), np.full(4, 0.15)])
        moved = np.tile([x - travelled[step - 1] if step else 0.0, 0.0, 0.0], (4, 1))
        batches = tracker.update(centres, moved, step * DT, DT)
        assert check(heightmap, batches, centres, np.full(4, 0.15), PatchConfig(), rng, 0.0) == 4
    assert len(looks) <= 12
