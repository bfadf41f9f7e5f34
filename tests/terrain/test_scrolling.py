"""Maps that travel with a robot keep the ground's velocity where they overlap."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import Deck, GridGeometry, HeightMap, Terrain
from smartmesh_ros.terrain.grid_track import STILL, RigidMotion, at_rest, follow, moved_on
from smartmesh_ros.terrain.motion import Changes, MotionConfig
from smartmesh_ros.terrain.surface_query import checked_points, ground_samples
from tests.bodies import about_z
from tests.grounds import terrain_of


def surface(geometry: GridGeometry, time: float) -> np.ndarray:
    """Ground that rises at 0.5 m/s in the west and falls in the east, by its place in the world."""
    xy = geometry.to_world(*np.mgrid[: geometry.rows, : geometry.columns])
    return (np.sin(xy[..., 0]) + xy[..., 1] - 0.5 * time * xy[..., 0]).astype(np.float32)


def at(x: float, time: float, **geometry: float) -> HeightMap:
    return HeightMap(np.zeros((8, 10)), resolution=0.1, origin=(x, 0.0), time=time, **geometry)


# Maps, and the velocity along x of the ground that they show [m/s].
TOLD = {
    "by whole cells": ([at(0.0, 1.0), at(0.2, 1.1)], 0.0),
    "long ago": ([at(0.0, 1.0), at(0.03, 3.0)], 0.0),
    "at once": ([at(0.0, 1.0), at(0.03, 1.0)], 0.0),
    "too far for a motion": ([at(0.0, 1.0), at(7.03, 1.1)], 0.0),
    "turned too far": ([at(0.0, 1.0), at(0.0, 1.1, yaw=3.0)], 0.0),
    "hardly turned": ([at(0.0, 1.0), at(0.0, 1.1, yaw=1e-3)], 0.0),
    # By less than a hundredth of a cell: ground at rest stays at rest, as a map's place is never quite the same.
    "at rest, very soon": ([at(0.03, 1.1), at(0.0306, 1.102)], 0.0),
    "sliding, very soon": ([at(0.0, 1.0), at(0.03, 1.1), at(0.0306, 1.102)], 0.3),
    "stopped": ([at(0.0, 1.0), at(0.03, 1.1), at(0.03, 1.2)], 0.0),
    # Not from where it rested first, of which its motion would be a share.
    "from its last map on": ([at(0.0, 0.0), at(0.0, 0.1), at(0.0, 0.2), at(0.03, 0.3)], 0.3),
    "the same yaw by another number": ([at(0.0, 1.0, yaw=math.pi), at(0.03, 1.1, yaw=-math.pi)], 0.3),
    "turned by the least of all numbers": ([at(0.0, 1.0), at(0.03, 1.1, yaw=5e-324)], 0.3),
}


@pytest.mark.parametrize(("maps", "speed"), TOLD.values(), ids=TOLD)
def test_ground_slides_as_its_maps_tell_and_one_that_travels_or_jumps_does_not(
    maps: list[HeightMap], speed: float
) -> None:
    terrain = Terrain()
    for each in maps:
        terrain.put("", each)
    assert maps[-1].track.motion == (pytest.approx((speed, 0.0, 0.0)) if speed else STILL)


def test_a_map_whose_heights_are_replaced_has_stopped() -> None:
    """`replace` says that the map is where it was."""
    terrain, slides = Terrain(at(0.0, 1.0)), at(0.03, 1.1)
    terrain.put("", slides)
    slides.replace(slides.heights, time=1.2)
    assert slides.track.motion == STILL
    assert slides.placed_at(1.3) == slides.geometry


def test_a_place_that_is_told_every_other_map_tells_the_motion_all_the_same() -> None:
    """Of 0.02 m/s: 0.67 hundredths of a cell with every second map."""
    terrain, rate = Terrain(at(0.0, 0.0)), 60.0
    found = []
    for index in range(1, 60):
        terrain.put("", at(0.02 * (index // 2 * 2) / rate, index / rate))
        found.append(terrain.tiles[""].track.motion.x)
    assert found[8:] == pytest.approx([0.02] * len(found[8:]), abs=0.007)


def test_a_map_that_turns_by_the_least_of_all_numbers_is_placed_as_one_that_does_not_turn() -> None:
    ground = at(0.03, 1.1)
    ground.slide((0.3, 0.0), 0.1, spin=5e-323)
    assert ground.placed_at(1.2).origin == pytest.approx((0.06, 0.0, 0.0))


places = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))


def velocity_after(motion: RigidMotion, duration: float) -> tuple[float, float]:
    """Velocity (x, y) [m/s] of sample (0, 0), which turns with the grid, after a duration [s]."""
    turned = complex(motion.x, motion.y) * np.exp(1j * motion.spin * duration)
    return float(turned.real), float(turned.imag)


@given(places, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-2.0, 2.0), st.integers(10, 240))
def test_the_track_of_a_steady_motion_finds_it_however_slow(
    place: tuple[float, float, float], x: float, y: float, spin: float, rate: int
) -> None:
    """Unless it is by whole cells, or so slow that a second's maps do not tell it."""
    first = GridGeometry(rows=8, columns=10, resolution=0.1, origin=(*place[:2], 0.0), yaw=place[2])
    true = RigidMotion(x, y, spin)
    track, went = at_rest(first, 0.0), first
    for index in range(1, rate + 1):
        ax, ay, yaw = moved_on(first, true, index / rate)
        went = GridGeometry(rows=8, columns=10, resolution=0.1, origin=(ax, ay, 0.0), yaw=yaw)
        track, _ = follow(track, went, index / rate, 0.25, 25.0)
    if track.moves:
        vx, vy = velocity_after(true, 1.0)
        assert track.motion == pytest.approx((vx, vy, spin), abs=0.05 * math.hypot(x, y) + 0.1 * abs(spin) + 1e-6)
    else:
        moves = follow(at_rest(first, 0.0), went, 0.2, 0.25, 1e9)[0]
        assert not moves.moves or abs(spin) < 1e-3


@pytest.mark.parametrize("motion", [MotionConfig(), MotionConfig(mode="interpolate"), MotionConfig(smoothing=3.0)])
@pytest.mark.parametrize("how", ["heights", "origin", "scrolled"])
@pytest.mark.parametrize("acceleration", [0.0, 3.0])
def test_maps_that_are_put_move_as_replaced_heights_do(how: str, acceleration: float, motion: MotionConfig) -> None:
    """A lift whose maps differ in their heights or in the origin's z, or travel; the time between maps varies."""
    replaced = HeightMap(np.zeros((20, 20)), resolution=1.0, motion=motion)
    terrain, time = Terrain(HeightMap(np.zeros((20, 20)), resolution=1.0, motion=motion)), 0.0
    for count in range(1, 12):
        time += 0.03 if count % 3 else 0.05
        z = 0.4 * time + 0.5 * acceleration * time * time
        replaced.replace(np.full((20, 20), z), time=time)
        heights, z = (np.zeros((20, 20)), z) if how == "origin" else (np.full((20, 20), z), 0.0)
        x, y = (-(count % 4), count // 2) if how == "scrolled" else (0, 0)
        terrain.put("", HeightMap(heights, resolution=1.0, origin=(x, y, z), time=time, motion=motion))
        for later in (0.0, 0.01, 0.02):
            expected, found = replaced.at([[4.5, 7.0]], time + later), terrain.at([[4.5, 7.0]], time + later)
            assert found.heights == pytest.approx(expected.heights, abs=1e-6)
            assert found.velocities == pytest.approx(expected.velocities, abs=1e-4)
    assert found.velocities[0] == pytest.approx(0.4 + acceleration * time, rel=0.2)


def coefficients(geometry: GridGeometry) -> np.ndarray:
    """Friction by the place in the world, unknown in the south."""
    xy = geometry.to_world(*np.mgrid[: geometry.rows, : geometry.columns])
    return np.where(xy[..., 1] < -3.0, np.nan, 1.0 + 0.5 * np.sin(xy[..., 0])).astype(np.float32)


@given(
    rows=st.integers(-9, 9), columns=st.integers(-11, 11), yaw=st.floats(-3.0, 3.0), rise=st.floats(-1.0, 1.0),
    changes=st.sampled_from(["motion", "correction"]), later=st.sampled_from([0.0, 0.1, 100.0]),
)  # fmt: skip
def test_velocities_and_friction_of_shared_samples_are_those_of_the_ground(
    rows: int, columns: int, yaw: float, rise: float, changes: Changes, later: float
) -> None:
    before = GridGeometry(rows=8, columns=10, resolution=0.2, origin=(3.0, -2.0, 0.0), yaw=yaw)
    x, y = before.to_world(rows, columns)
    after = GridGeometry(rows=8, columns=10, resolution=0.2, origin=(float(x), float(y), rise), yaw=yaw)
    motion, friction = MotionConfig(changes=changes), coefficients(before)
    terrain = Terrain(HeightMap(surface(before, 0.0), geometry=before, friction=friction, motion=motion))
    new = HeightMap(surface(after, later) - rise, geometry=after, time=later, motion=motion)
    terrain.put("", new)
    known_rows, known_columns = np.arange(8) + rows, np.arange(10) + columns  # in the map before
    is_new = ((known_rows < 0) | (known_rows >= 8))[:, None] | (known_columns < 0) | (known_columns >= 10)
    wanted = np.where(is_new, np.nan, coefficients(after))
    np.testing.assert_allclose(np.full((8, 10), new.friction), np.where(is_new.all(), 1.0, wanted), atol=1e-5)
    speeds = -0.5 * after.to_world(*np.mgrid[:8, :10])[..., 0]
    found = new.sample(np.arange(80).reshape(8, 10), later).velocities
    rises = ~is_new & (changes == "motion" and later == 0.1)
    np.testing.assert_allclose(found, np.where(rises, speeds, 0.0), atol=1e-3)


PLACED = GridGeometry(rows=8, columns=10, resolution=0.2)
OTHER = GridGeometry(rows=5, columns=5, resolution=0.7, origin=(1.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("before", "after", "given_friction", "wanted"),
    [
        (coefficients(PLACED), replace(PLACED, origin=(0.05, 0.03, 0.0)), None, coefficients(PLACED)),  # it slid
        (0.2, OTHER, None, 0.2), (np.full((8, 10), 0.2), OTHER, None, 1.0),
        *((coefficients(PLACED), PLACED, each, each) for each in (1.0, 0.3, np.full((8, 10), 0.4, np.float32))),
    ],
)  # fmt: skip
def test_friction_slides_with_its_map_and_a_new_one_replaces_it_and_one_coefficient_is_that_of_any_grid(
    before: Any, after: GridGeometry, given_friction: Any, wanted: Any
) -> None:
    terrain = Terrain(HeightMap(np.zeros((8, 10)), geometry=PLACED, friction=before))
    new = HeightMap(np.zeros((after.rows, after.columns)), geometry=after, time=0.1, friction=given_friction)
    terrain.put("", new)
    np.testing.assert_array_equal(new.friction, wanted)


def test_friction_at_points_is_that_of_the_nearest_sample_of_the_first_map_with_ground() -> None:
    heights = np.zeros((5, 5))
    heights[2, 2] = np.nan
    holed = HeightMap(heights, resolution=1.0, friction=np.arange(25.0).reshape(5, 5))
    terrain = terrain_of(holed=holed, below=HeightMap(np.full((9, 9), -1.0), resolution=1.0, friction=0.5))
    points = np.array([[1.4, 0.6], [3.6, 4.0], [2.0, 2.0], [6.0, 6.0], [20.0, 0.0]])
    np.testing.assert_allclose(friction_at(terrain, points), [6.0, 24.0, 0.5, 0.5, np.nan])
    assert friction_at(Terrain(HeightMap(np.zeros((5, 5)), resolution=1.0)), points[:1]) == 1.0
    turned = about_z(math.pi / 2.0)  # the deck's x is the terrain's y
    terrain.put("deck", Deck(HeightMap(np.zeros((5, 5)), resolution=1.0, friction=holed.friction), position=(4, 0, 1),
                             orientation=turned))  # fmt: skip
    np.testing.assert_allclose(friction_at(terrain, points), [16.0, 4.0, 12.0, 0.5, np.nan])


def friction_at(terrain: Terrain, points: np.ndarray) -> np.ndarray:
    return ground_samples(terrain, checked_points(points), 0.0).friction
