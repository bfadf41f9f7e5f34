"""The mapper of the studies: what its sensors see, what its maps say of the truth, and the bag that it made."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from smartmesh_ros import GridGeometry, InputError
from smartmesh_ros.io.rasters import RasterConfig, from_grid_map
from smartmesh_ros.node.inputs.adapters.grid_map import raster_from
from smartmesh_ros.node.sensor.range_sensors import RangeSensor
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.testing import bags
from studies.mapper import (
    NO_DRIFT,
    DepthCamera,
    DriftConfig,
    Lidar,
    LoopPath,
    MapFrame,
    MapperConfig,
    MappingConfig,
    Pose,
    RangeNoise,
    mapped_terrain,
    true_ground,
)
from studies.mapper.elevation_mapper import ElevationMapper
from studies.mapper.grid_map import grid_map_arrays
from studies.mapper.mapping import true_heights
from studies.mapper.poses import on_ground
from studies.mapper.rays import cast_rays
from studies.mapper.sensors import Scan, scan
from studies.mapper.truth import TruthConfig

TESTS = Path(__file__).parents[1]
BAG = TESTS / "data" / "mapper"
SILENT = RangeNoise(constant=0.0, quadratic=0.0)
EXACT = MapperConfig(unevenness=0.0, growth=0.0, least_deviation=0.0)
STANDING = LoopPath(radii=(1e-6, 1e-6), speed=0.0)  # at the origin, looking along +y
GROUND = true_ground(TruthConfig())


def level(heights: Any = 0.0, side: float = 12.0, resolution: float = 0.05) -> Surface:
    """A square around the origin, level or of the given heights."""
    size = round(side / resolution) + 1
    geometry = GridGeometry(rows=size, columns=size, resolution=resolution, origin=(-0.5 * side, -0.5 * side, 0.0))
    return Surface(geometry, np.broadcast_to(np.asarray(heights, np.float64), (size, size)).copy())


def silent() -> tuple[RangeSensor, ...]:
    """The usual sensors, without noise."""
    return DepthCamera(noise=SILENT), Lidar(noise=SILENT)


def last_of(config: MappingConfig, ground: Surface = GROUND) -> MapFrame:
    *_, last = mapped_terrain(config, ground)
    return last


def rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


@given(seed=st.integers(0, 10**6), roughness=st.floats(0.0, 1.0))
def test_a_ray_ends_where_it_first_meets_the_triangles_of_the_ground(seed: int, roughness: float) -> None:
    rng = np.random.default_rng(seed)
    geometry = GridGeometry(rows=12, columns=15, resolution=0.3, origin=(-1.0, 2.0, 0.5))
    ground = Surface(geometry, rng.normal(0.0, roughness, (12, 15)).astype(np.float32).astype(np.float64))
    start = np.array([*geometry.to_world(*rng.uniform(1.0, 10.0, 2)), 0.0])
    start[2] = ground.below(start[None])[0] + rng.uniform(0.05, 2.0)
    directions = rng.normal(size=(30, 3))
    directions[0], directions[1, :2] = (0.0, 0.0, -1.0), 0.0
    directions[2, 0], directions[3, 1], directions[4, :2] = 0.0, 0.0, (0.5, 0.5)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reach = 3.0
    ranges = cast_rays(ground, start, directions, reach)
    assert ranges[0] == pytest.approx(start[2] - ground.below(start[None])[0])
    for direction, found in zip(directions, ranges, strict=True):
        end = reach if math.isnan(found) else found
        way = start + np.linspace(0.0, end, 400)[:-1, None] * direction
        gap = way[:, 2] - ground.below(way)
        inside = np.cumprod(~np.isnan(gap)).astype(bool)  # up to where the ray leaves the map
        assert (gap[inside] > -1e-9).all()
        if not math.isnan(found):
            assert inside.all()
            hit = start + found * direction
            assert hit[2] == pytest.approx(ground.below(hit[None])[0], abs=1e-9)


@pytest.mark.parametrize(
    "sensor",
    [
        Lidar(beams=8, fan=(-1.2, -0.15), steps=8000, sectors=1, farthest=10.0),
        Lidar(beams=8, fan=(-1.2, -0.15), steps=8000, sectors=1, noise=RangeNoise(constant=0.0, quadratic=0.004)),
    ],
    ids=["constant and quadratic", "quadratic"],
)
def test_the_noise_of_a_range_grows_with_its_square(sensor: Lidar) -> None:
    pose, ground = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.3), level(side=20.0, resolution=0.5)
    clean = scan(replace(sensor, noise=SILENT), ground, pose, 0, np.random.default_rng(0)).ranges
    noisy = scan(sensor, ground, pose, 0, np.random.default_rng(0)).ranges
    true, errors = clean.reshape(8, -1), (noisy - clean).reshape(8, -1)
    expected = sensor.noise.constant + sensor.noise.quadratic * true[:, 0] ** 2
    assert true[0, 0] < 0.9
    assert true[-1, 0] > 5.0
    np.testing.assert_allclose(errors.std(axis=1), expected, rtol=0.05)
    assert (np.abs(errors.mean(axis=1)) < 5.0 * expected / math.sqrt(errors.shape[1])).all()


@pytest.mark.parametrize("sensor", silent(), ids=["camera", "lidar"])
def test_a_sensor_returns_what_is_in_its_range_and_nothing_above(sensor: RangeSensor) -> None:
    ground, pose = level(side=60.0, resolution=0.5), Pose(1.0, 2.0, 0.0, 0.05, -0.04, 0.7)
    found = scan(sensor, ground, pose, 3, np.random.default_rng(0))
    rays = sensor.directions_b(3) @ pose.rotation.T
    start = pose.position + pose.rotation @ sensor.position_b
    true = -start[2] / rays[:, 2]
    within = (rays[:, 2] < 0.0) & (true >= sensor.nearest) & (true <= sensor.farthest)
    assert 0 < within.sum() < len(rays)
    np.testing.assert_allclose(found.ranges, true[within])
    points_w = found.points_b @ pose.rotation.T + pose.position
    np.testing.assert_allclose(points_w[:, 2], 0.0, atol=1e-9)


def test_the_sectors_of_a_turn_are_the_turn() -> None:
    lidar = Lidar()
    whole = replace(lidar, sectors=1).directions_s(0)
    parts = np.concatenate([lidar.directions_s(look) for look in range(lidar.sectors)])
    rounded = [{tuple(ray) for ray in np.round(rays, 6).tolist()} for rays in (whole, parts)]
    assert rounded[0] == rounded[1]
    assert len(rounded[0]) == lidar.beams * lidar.steps


@pytest.mark.parametrize("height", [2.0, 0.0], ids=["wall", "no wall"])
def test_ground_behind_a_wall_is_not_seen(height: float) -> None:
    ground = level()
    y = ground.geometry.to_world(np.arange(ground.geometry.rows), 0)[:, 1]
    ground.heights[(y > 1.5) & (y < 1.7)] = height
    config = MappingConfig(duration=1.0, path=STANDING, sensors=silent(), drift=NO_DRIFT, mapper=EXACT)
    frame = last_of(config, ground)
    x, y = np.moveaxis(frame.geometry.to_world(*np.mgrid[:80, :80]), -1, 0)
    known = np.isfinite(frame.elevation)
    assert known[(y > 0.7) & (y < 1.3) & (np.abs(x) < 0.5)].all()
    behind = known[(y > 1.85) & (y < 3.5) & (np.abs(x) < 0.5)]
    assert not behind.any() if height else behind.mean() > 0.5
    np.testing.assert_array_equal(known, np.isfinite(frame.variance))


def test_a_mapper_without_noise_and_drift_has_the_truth_where_it_saw_it() -> None:
    frame = last_of(MappingConfig(duration=4.0, sensors=silent(), drift=NO_DRIFT, mapper=EXACT))
    assert frame.estimate == frame.pose
    assert np.isfinite(frame.elevation).mean() > 0.7
    # A point lies at most half a cell's diagonal from the cell's middle, and no triangle is steeper than this.
    within = GROUND.steepest * frame.geometry.resolution * math.sqrt(0.5)
    assert np.nanmax(np.abs(frame.error)) <= within + 1e-6
    assert rms(frame.error) < 0.006
    assert abs(np.nanmean(frame.error)) < 0.002


def test_variances_shrink_and_errors_are_as_large_as_they_say() -> None:
    # From straight above and with little noise, so that noise does not choose which cell a point falls into.
    noise = RangeNoise(constant=0.002, quadratic=0.0)
    above = DepthCamera(position_b=(0.0, 0.0, 3.0), pitch=0.5 * math.pi, view=(0.6, 0.6), noise=noise)
    config = MappingConfig(duration=1.0, path=STANDING, sensors=(above,), drift=NO_DRIFT, mapper=EXACT)
    frames = list(mapped_terrain(config, level()))
    for earlier, later in itertools.pairwise(frames):
        known = np.isfinite(earlier.variance)
        assert (later.variance[known] <= earlier.variance[known]).all()
    first, last = frames[0], frames[-1]
    both = np.isfinite(first.variance) & np.isfinite(last.variance)
    assert np.median(last.variance[both] / first.variance[both]) < 0.25
    score = np.abs(last.error / np.sqrt(last.variance))[np.isfinite(last.error)]
    assert (score < 1.0).mean() == pytest.approx(0.683, abs=0.05)
    assert (score < 2.0).mean() == pytest.approx(0.954, abs=0.03)
    assert rms(last.error[both]) < 0.6 * rms(first.error[both])


def test_points_are_weighted_by_what_their_noise_is_worth_vertically() -> None:
    mapper = ElevationMapper(MapperConfig(cells=21, unevenness=0.02))
    pose = Pose(0.0, 0.0, 0.5, 0.0, 0.0, 1.0)
    mapper.follow(pose)
    slant = np.array([[0.0, 0.0, -1.0], [0.0, 0.6, -0.8], [0.0, -0.8, -0.6]])
    ranges, deviations = np.array([1.0, 1.01, 1.02]), np.array([0.05, 0.04, 0.09])
    for k in range(3):  # all of them into the middle cell
        start = np.array([0.0, 0.0, 1.0]) - slant[k] * (0.0, 1.0, 0.0)
        mapper.add(Scan(start, slant[k : k + 1], ranges[k : k + 1], deviations[k : k + 1]), pose)
    heights = 1.5 + ranges * slant[:, 2]
    weights = 1.0 / ((deviations * slant[:, 2]) ** 2 + 0.02**2)
    assert mapper.heights[10, 10] == pytest.approx((weights * heights).sum() / weights.sum())
    assert mapper.variances[10, 10] == pytest.approx(1.0 / weights.sum())
    assert np.isfinite(mapper.heights).sum() == 1
    mapper.wait(10.0)
    assert mapper.variances[10, 10] == pytest.approx(1.0 / weights.sum() + 10.0 * mapper.config.growth)


def test_the_usual_mapper_is_as_good_as_it_says_where_the_pose_is_known() -> None:
    on_level = last_of(MappingConfig(duration=5.0, path=STANDING, drift=NO_DRIFT), level())
    assert rms(on_level.error) < rms(np.sqrt(on_level.variance))
    driven = last_of(MappingConfig(duration=5.0, drift=NO_DRIFT))
    score = np.abs(driven.error / np.sqrt(driven.variance))[np.isfinite(driven.error)]
    assert (score < 3.0).mean() > 0.95


@given(moves=st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), min_size=1, max_size=5))
def test_scrolling_keeps_what_lies_where_in_the_world(moves: Sequence[tuple[float, float]]) -> None:
    mapper = ElevationMapper(MapperConfig(cells=21, resolution=0.2))
    mapper.follow(Pose(0.3, -0.4, 0.0, 0.0, 0.0, 0.0))
    rows, columns = np.mgrid[:21, :21]

    def places() -> NDArray[np.int64]:
        return np.stack([rows + mapper.first[0], columns + mapper.first[1]])

    def written(row: Any, column: Any) -> Any:
        return 100.0 * row + column

    mapper.heights[:] = written(*places())
    mapper.variances[:] = 1.0
    held = np.ones((21, 21), bool)
    x, y = 0.3, -0.4
    for dx, dy in moves:
        x, y = x + dx, y + dy
        before = {tuple(place): kept for place, kept in zip(places().reshape(2, -1).T.tolist(), held.flat, strict=True)}
        mapper.follow(Pose(x, y, 0.0, 0.0, 0.0, 0.0))
        now = places()
        held = np.array([before.get(tuple(place), False) for place in now.reshape(2, -1).T.tolist()]).reshape(21, 21)
        np.testing.assert_array_equal(mapper.heights, np.where(held, written(*now), np.nan))
        np.testing.assert_array_equal(np.isfinite(mapper.variances), held)
        middle = mapper.geometry.to_world(10, 10)
        assert np.abs(middle - (x, y)).max() <= 0.1 + 1e-9


@given(
    error=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(-0.05, 0.05)),
    place=st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)),
)
def test_a_correction_moves_the_whole_map_with_the_rover(
    error: tuple[float, float, float, float], place: tuple[float, float]
) -> None:
    dx, dy, dz, turn = error
    after = Pose(*place, 1.0, 0.0, 0.0, 0.8)
    before = Pose(place[0] + dx, place[1] + dy, 1.0 + dz, 0.0, 0.0, 0.8 + turn)

    def tilted(x: Any, y: Any) -> Any:
        return 0.5 + 0.2 * (x - place[0]) - 0.1 * (y - place[1])

    mapper = ElevationMapper(MapperConfig(cells=41))
    mapper.follow(before)
    rows, columns = np.mgrid[:41, :41]
    x, y = np.moveaxis(mapper.geometry.to_world(rows, columns), -1, 0)
    # The plane as a rover sees it that takes itself to be at ``before``.
    cos, sin = math.cos(turn), math.sin(turn)
    back_x = after.x + cos * (x - before.x) + sin * (y - before.y)
    back_y = after.y - sin * (x - before.x) + cos * (y - before.y)
    mapper.heights[:], mapper.variances[:] = tilted(back_x, back_y) + dz, 0.01
    mapper.correct(before, after)
    x, y = np.moveaxis(mapper.geometry.to_world(rows, columns), -1, 0)
    inner = np.s_[6:-6, 6:-6]  # away from what was not on the map
    np.testing.assert_allclose(mapper.heights[inner], tilted(x, y)[inner], atol=1e-9)
    np.testing.assert_allclose(mapper.variances[inner], 0.01)
    assert np.abs(mapper.geometry.to_world(20, 20) - place).max() <= 0.05 + 1e-9


def test_a_hole_stays_a_hole_when_the_map_is_corrected() -> None:
    mapper = ElevationMapper(MapperConfig(cells=21))
    before, after = Pose(0.0, 0.0, 0.1, 0.0, 0.0, 0.0), Pose(0.03, 0.0, 0.0, 0.0, 0.0, 0.0)
    mapper.follow(before)
    mapper.heights[:], mapper.variances[:] = 1.0, 0.01
    mapper.heights[5, 7] = mapper.variances[5, 7] = np.nan
    mapper.correct(before, after)
    holes = np.argwhere(np.isnan(mapper.heights[1:-1, 1:-1])) + 1
    assert holes.tolist() == [[5, 7]]
    np.testing.assert_allclose(mapper.heights[6:9, 6:9], 0.9)


def test_a_closed_loop_brings_the_error_of_the_map_down() -> None:
    drift = DriftConfig(horizontal=0.01, vertical=0.03, closures=(3.0,))
    closed, open_ = [], []
    for seed in range(5):
        config = MappingConfig(duration=3.0, seed=seed, drift=drift)
        frames = list(mapped_terrain(config, GROUND))
        before, after = frames[-2:]
        assert [frame.closed for frame in frames] == [False] * 29 + [True]
        off = [np.array(frame.estimate) - frame.pose for frame in (before, after)]
        assert np.linalg.norm(off[1]) < 0.5 * np.linalg.norm(off[0])
        # The map jumps by what the pose does; what its own smear adds stays.
        jump = np.nanmedian(after.error) - np.nanmedian(before.error)
        assert jump == pytest.approx(after.estimate.z - before.estimate.z, abs=0.02)
        closed.append(rms(after.error))
        open_.append(rms(before.error))
    assert np.mean(closed) < 0.6 * np.mean(open_)


def test_maps_drift_with_the_pose() -> None:
    quiet = MappingConfig(duration=3.0, drift=NO_DRIFT)
    drifting = replace(quiet, drift=DriftConfig(vertical=0.1, horizontal=0.0, yaw=0.0, closures=()))
    assert rms(last_of(drifting).error) > 5.0 * rms(last_of(quiet).error)


def test_the_same_seed_makes_the_same_maps_and_another_one_others() -> None:
    config = MappingConfig(duration=0.6)
    first, again = (list(mapped_terrain(config, GROUND)) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert one[:2] == other[:2]
        assert one.estimate == other.estimate
        for layer, repeated in zip(one[2:5], other[2:5], strict=True):
            np.testing.assert_array_equal(layer, repeated)
    elsewise = last_of(replace(config, seed=1))
    assert elsewise.estimate != first[-1].estimate
    assert (elsewise.elevation != first[-1].elevation).any()
    # Other sensors do not make another drift.
    assert last_of(replace(config, sensors=silent())).estimate[2] == pytest.approx(first[-1].estimate.z, abs=1e-12)


@pytest.mark.parametrize("rate", [5.0, 7.0, 20.0])
def test_maps_come_in_time_and_around_the_rover(rate: float) -> None:
    frames = list(mapped_terrain(MappingConfig(duration=2.0, rate=rate), GROUND))
    np.testing.assert_allclose([frame.stamp for frame in frames], np.arange(1, 2 * rate + 1) / rate)
    for frame in frames:
        middle = frame.geometry.to_world(40, 40)
        assert np.abs(middle - frame.estimate[:2]).max() <= 0.05 + 1e-9
        assert frame.elevation.dtype == frame.variance.dtype == np.float32
        assert not any(layer.flags.writeable for layer in frame[2:5])
        np.testing.assert_allclose(frame.truth, true_heights(GROUND, frame.geometry), atol=1e-6)


def test_a_rate_that_no_mapper_has_is_refused() -> None:
    with pytest.raises(InputError, match="5 to 20 Hz"):
        MappingConfig(rate=30.0)


def test_the_rover_stands_on_a_slope_as_it_is() -> None:
    y = np.linspace(-6.0, 6.0, 241)[:, None]
    pose = on_ground(level(0.2 * y), 1.0, 0.5, math.pi / 2.0)  # uphill
    assert pose.z == pytest.approx(0.1)
    np.testing.assert_allclose(
        pose.rotation @ (1.0, 0.0, 0.0), np.array([0.0, 1.0, 0.2]) / math.hypot(1.0, 0.2), atol=1e-9
    )
    across = on_ground(level(0.2 * y), 1.0, 0.5, 0.0)
    np.testing.assert_allclose(
        across.rotation @ (0.0, 1.0, 0.0), np.array([0.0, 1.0, 0.2]) / math.hypot(1.0, 0.2), atol=1e-9
    )
    with pytest.raises(InputError, match="true ground"):
        on_ground(level(), 6.0, 0.0, 0.0)


def test_grid_map_arrays_are_the_map_and_cells_keep_their_place_in_the_buffer() -> None:
    config = MappingConfig(duration=2.0, rate=5.0, mapper=MapperConfig(cells=30), drift=NO_DRIFT)
    places: dict[tuple[int, int], tuple[int, int]] = {}
    starts = set()
    for frame in mapped_terrain(config, GROUND):
        arrays = grid_map_arrays(frame)
        starts.add(arrays.start)
        for name, expected in (("elevation", frame.elevation), ("variance", frame.variance)):
            raster = from_grid_map(
                arrays.layers[name],
                start=arrays.start,
                centre=arrays.centre,
                resolution=arrays.resolution,
                config=RasterConfig(),
            )
            np.testing.assert_array_equal(raster.heights, expected)
            np.testing.assert_allclose(raster.geometry.origin, frame.geometry.origin, atol=1e-9)
        corner = frame.geometry.to_world(frame.geometry.rows - 1, frame.geometry.columns - 1)
        for i, j in np.ndindex(30, 30):  # cells of the buffer, and the lattice's cells they hold
            along_x, along_y = (i - arrays.start[0]) % 30, (j - arrays.start[1]) % 30
            x, y = np.rint(corner / arrays.resolution).astype(int) - (along_x, along_y)
            assert places.setdefault((int(x), int(y)), (i, j)) == (i, j)
    assert len(starts) > 3


def grid_maps() -> list[Any]:
    """The grid maps of the shipped bag, read without an installed grid_map_msgs."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for file in sorted((TESTS / "interfaces" / "grid_map_msgs" / "msg").glob("*.msg")):
        types.register(get_types_from_msg(file.read_text(), f"grid_map_msgs/msg/{file.stem}"))
    records = [record for record in bags.read(BAG) if record.type_name == "grid_map_msgs/msg/GridMap"]
    return [types.deserialize_cdr(record.data, record.type_name) for record in records]


def test_the_shipped_bag_holds_maps_of_the_true_ground() -> None:
    assert sum(file.stat().st_size for file in BAG.iterdir()) < 400_000
    messages = grid_maps()
    assert len(messages) == 25
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in messages]
    np.testing.assert_allclose(np.diff(stamps), 0.2, atol=1e-6)
    assert len({(message.outer_start_index, message.inner_start_index) for message in messages}) > 5
    offsets = []
    for message in messages:
        elevation = raster_from(message, RasterConfig(), 10_000)
        variance = raster_from(message, RasterConfig(layer="variance"), 10_000)
        known = np.isfinite(elevation.heights)
        np.testing.assert_array_equal(known, np.isfinite(variance.heights))
        assert (variance.heights[known] > 0.0).all()
        assert known.mean() > 0.5
        error = elevation.heights - true_heights(GROUND, elevation.geometry)
        assert rms(error - np.nanmedian(error)) < 0.05
        offsets.append(float(np.nanmedian(error)))
    # A loop is closed in the middle: the map drifts up to there, and jumps back.
    assert abs(offsets[11]) > 3.0 * abs(offsets[12])
    assert abs(offsets[11] - offsets[12]) > 0.02
