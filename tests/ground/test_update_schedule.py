"""Patches that are not brought up to date in every step, and time that goes on without steps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import BodyState, HeightMap, PatchConfig, PhysicsConfig, Sphere, Terrain, World, WorldConfig
from smartmesh_ros.ground.ground import FIRST_MAPS, LONGEST_LIFE, SHORTEST_LIFE, UpdateSchedule
from smartmesh_ros.patches.config import PatchKind
from tests.grounds import level, moving

RATE, SIDE = 240.0, 41
DT = 1.0 / RATE
RISE = 0.3  # [m/s]
RADIUS = 0.15
STEPS_PER_MAP = 12


class Rising:
    """A ball on ground that rises steadily, with the same ``slope`` everywhere along y."""

    def __init__(self, kind: PatchKind, rate: float, slope: float = 0.0) -> None:
        self.slope = slope
        self._steps = 0
        self._map = HeightMap(self._heights(0.0), resolution=0.1)
        config = WorldConfig(physics=PhysicsConfig(rate=RATE), patch=PatchConfig(kind=kind, rate=rate))
        self.world = World(self._map, config)
        for _ in range(3 * STEPS_PER_MAP):  # by then the ground's velocity is known
            self.step()
        above = self.height(2.0) + RADIUS * math.hypot(1.0, slope)
        self.world.spawn("ball", Sphere(RADIUS), 1.0, BodyState((2.0, 2.0, above), linear=(0.0, 0.0, RISE)))

    def height(self, y: float) -> float:
        """Of the ground now [m]."""
        return RISE * self.world.time + self.slope * y

    def step(self) -> None:
        """One step, after the map that is due."""
        if self._steps % STEPS_PER_MAP == 0:
            self._map.replace(self._heights(self.world.time), time=self.world.time)
        self._steps += 1
        self.world.step()

    def _heights(self, time: float) -> np.ndarray:
        return RISE * time + self.slope * 0.1 * np.arange(SIDE)[:, None] * np.ones(SIDE)


@given(
    rate=st.sampled_from([0.0, 30.0, 60.0, 100.0, 120.0, 240.0, 1000.0]),
    maps=st.lists(st.booleans(), min_size=1, max_size=60),
    dt=st.sampled_from([1.0 / 60.0, DT, 1.0 / 960.0]),
)
def test_patches_are_due_with_maps_and_no_later_than_the_rate_says(rate: float, maps: list[bool], dt: float) -> None:
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule = Terrain.of(heightmap), UpdateSchedule()
    steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
    age, lasts, waiting = 0, 0, False
    for step, comes in enumerate(maps):
        if comes:
            heightmap.replace(np.full((5, 5), 0.001 * step), time=step * dt)
        waiting |= comes
        age += 1
        if schedule.due(terrain):
            lasts = schedule.begin(terrain, step * dt, dt, rate)
            assert 1 <= lasts <= (LONGEST_LIFE * steps if steps > 1 else 1)
            age, waiting = 0, False
        assert not waiting or age < SHORTEST_LIFE * steps, "a map is left for later only if patches are new"
        assert age < lasts, "nor are they left longer than they were made for"


def followed(maps: int, *, behind_real_time: bool) -> list[int]:
    """Steps of 120 in which patches at 60 Hz are brought up to date, with a map every so many steps."""
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule, found = Terrain.of(heightmap), UpdateSchedule(), []
    for step in range(120):
        if step % maps == 0:
            heightmap.replace(np.full((5, 5), 0.001 * step), time=step * DT)
        if schedule.due(terrain, behind_real_time=behind_real_time):
            lasts = schedule.begin(terrain, step * DT, DT, 60.0, behind_real_time=behind_real_time)
            assert lasts <= LONGEST_LIFE * 4
            found.append(step)
    return found


def test_of_many_maps_patches_follow_the_first_at_once_and_then_some() -> None:
    found = followed(1, behind_real_time=False)
    assert found[:FIRST_MAPS] == list(range(FIRST_MAPS))
    assert set(np.diff(found[FIRST_MAPS:]).tolist()) == {2}


@pytest.mark.parametrize(
    ("maps", "rate", "lasts"), [(1, 240.0, 1), (1, 60.0, 1), (2, 60.0, 2), (4, 60.0, 5), (12, 60.0, 4)]
)
def test_patches_last_until_the_next_map_if_that_is_soon(maps: int, rate: float, lasts: int) -> None:
    """Maps every so many steps. One that comes a little late is waited for."""
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule = Terrain.of(heightmap), UpdateSchedule()
    for number in range(3):
        heightmap.replace(np.full((5, 5), 0.001 * number), time=number * maps * DT)
    assert schedule.begin(terrain, 2 * maps * DT, DT, rate) == lasts


@given(st.integers(1, 12))
def test_in_a_hurry_patches_last_as_long_as_the_rate_says_however_often_maps_come(maps: int) -> None:
    """A late loop would update the more often, in simulated time, the later it is."""
    found = followed(maps, behind_real_time=True)
    # Maps that come as seldom as patches are due are waited for as ever.
    assert set(np.diff(found[2:]).tolist()) <= ({4, 5, 6} if maps in (4, 5) else {4})


@pytest.mark.parametrize("behind_real_time", [False, True])
def test_new_tiles_are_followed_at_once(behind_real_time: bool) -> None:
    terrain, schedule = Terrain.of(HeightMap(np.zeros((5, 5)), resolution=1.0)), UpdateSchedule()
    schedule.begin(terrain, 0.0, DT, 10.0)
    assert not schedule.due(terrain, behind_real_time=behind_real_time)
    terrain.put("", HeightMap(np.ones((5, 5)), resolution=1.0))
    assert schedule.due(terrain, behind_real_time=behind_real_time)


@pytest.mark.parametrize("kind", ["auto", "heightfield", "trimesh"])
def test_between_updates_colliders_go_on_as_the_ground_does(kind: PatchKind) -> None:
    """The ball stands on it, and PyBullet has the collider where the ground is, in every step."""
    ground = Rising(kind, rate=40.0)
    with ground.world as world:
        for _ in range(60):
            ground.step()
            _, y, z = world.state("ball").position
            assert z - RADIUS == pytest.approx(ground.height(y), abs=1e-4)
            follower = world.ground.followers[0]
            points = world.client.getClosestPoints(follower.body, follower.collider, 0.05)
            assert max(point[6][2] for point in points) == pytest.approx(ground.height(y), abs=1e-4)


def test_what_fell_off_the_map_asks_for_no_updates_however_fast_it_gets() -> None:
    with World(HeightMap(np.zeros((41, 41)), resolution=0.1)) as world:
        world.spawn("ball", Sphere(RADIUS), 1.0, BodyState((9.0, 2.0, 0.0), linear=(0.0, 0.0, -45.0)))
        world.step(480)  # 65 m/s
        assert world.refreshes <= 480 / 4 + 1


def test_patches_are_ready_before_each_step_and_bodies_have_not_moved_yet() -> None:
    """Whoever shows patches need not wait for the physics."""
    ground, seen = Rising("heightfield", rate=40.0), []
    with ground.world as world:

        def prepared() -> None:
            seen.append((world.time, world.refreshes, world.ground.time, world.state("ball").position[2]))

        z, refreshes = world.state("ball").position[2], world.refreshes
        world.step(13, prepared)
        times, counts, made, heights = np.array(seen).T
        np.testing.assert_allclose(np.diff(times), DT)
        assert heights[0] == z
        assert heights[-1] < world.state("ball").position[2]
        assert counts[0] == refreshes + 1  # a body has come
        assert counts[-1] == refreshes + 3
        assert (made <= times).all()
        np.testing.assert_allclose(made[1:][np.diff(counts) > 0], times[1:][np.diff(counts) > 0])


@pytest.mark.parametrize("kind", ["auto", "heightfield", "trimesh"])
@pytest.mark.parametrize("rate", [0.0, 120.0])
def test_bodies_ride_on_the_ground_although_steps_are_skipped(kind: PatchKind, rate: float) -> None:
    """PyBullet moves colliders in steps only: where time goes on without, they are brought to where the ground is."""
    skipped, ground = 3, Rising(kind, rate)
    with ground.world as world:
        for step in range(240):
            if step % 5 == 0:
                world.skip(skipped)
            ground.step()
            _, y, z = world.state("ball").position
            # By what the ground rose while the ball stood still, less what the solver made good since.
            assert z - RADIUS > ground.height(y) - RISE * skipped * DT - 5e-4


@pytest.mark.parametrize("kind", ["auto", "heightfield"])
@pytest.mark.parametrize("speed", [3.0, 20.0])
@pytest.mark.parametrize("radius", [0.02, 0.2])
def test_fast_bodies_do_not_leave_their_patches_before_these_follow(
    radius: float, speed: float, kind: PatchKind
) -> None:
    """On level ground a ball rolls as high as it started."""
    heightmap = HeightMap(np.zeros((5, 101)), resolution=0.5)
    config = WorldConfig(physics=PhysicsConfig(rate=RATE), patch=PatchConfig(kind=kind))
    with World(heightmap, config) as world:
        rolling = BodyState((1.0, 1.0, radius), linear=(speed, 0.0, 0.0), angular=(0.0, speed / radius, 0.0))
        world.spawn("ball", Sphere(radius), 1.0, rolling)
        for _ in range(240):
            world.step()
            assert world.state("ball").position[2] == pytest.approx(radius, abs=2e-4)
        assert world.state("ball").linear == pytest.approx((speed, 0.0, 0.0), rel=0.01, abs=0.01)


@pytest.mark.parametrize("kind", ["auto", "heightfield", "trimesh"])
def test_patches_that_leave_maps_out_follow_ground_that_accelerates(kind: PatchKind) -> None:
    """Maps come with every step, patches follow every fourth: what changed since the last that was looked at took four
    times as long as since the map before."""

    def ground(time: float) -> float:
        return 1.5 * time**2

    patch = PatchConfig(kind=kind, rate=30.0)
    with World(level(SIDE), WorldConfig(physics=PhysicsConfig(rate=RATE), patch=patch)) as world:
        world.spawn("ball", Sphere(RADIUS), 1.0, BodyState((0.0, 0.0, RADIUS)))
        for step in moving(world, ground, 240, every=1):
            if step > 24:
                assert world.state("ball").position[2] - RADIUS == pytest.approx(ground(world.time), abs=3e-4)


@pytest.mark.parametrize("rate", [0.0, 60.0])
@pytest.mark.parametrize("kind", ["heightfield", "auto"])
def test_a_ball_stays_on_a_seesaw_however_steep(kind: PatchKind, rate: float) -> None:
    """Ground rises and falls where it is; a collider that turns about a point aside would move into the ball."""
    across = 0.5 * (np.indices((41, 41))[1] - 20)

    def slope(time: float) -> float:
        return 0.8 * math.sin(3.0 * time)

    with World(level(41, 0.5), WorldConfig(patch=PatchConfig(kind=kind, rate=rate))) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.22, 0.2, 0.2)))
        for step in moving(world, lambda time: slope(time) * across, 100, every=1):
            steep, (x, _, z) = slope(world.time), world.state("ball").position
            clearance = (z - steep * x) / math.hypot(1.0, steep) - 0.2
            assert step < 5 or abs(clearance) < 5e-4  # the ground's velocity is known after two maps
