"""Bodies are taken along by corrections of the ground under them, and gain nothing by it."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from smartmesh_ros import BodyState, HeightMap, MotionConfig, PhysicsConfig, Terrain, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from tests.bodies import rotation
from tests.urdfs import HUSKY

CELLS, RESOLUTION = 61, 0.1
AXIS = (np.arange(CELLS) - CELLS // 2) * RESOLUTION
SHAPES: dict[str, Shape] = {
    "box": Box(0.4, 0.4, 0.3),
    "ball": Sphere(0.15),
    "cylinder": Cylinder(radius=0.2, height=0.3),
}


def slope(angle: float) -> NDArray[np.float64]:
    return np.tile(math.tan(angle) * AXIS, (CELLS, 1))


@contextmanager
def on_ground(heights: NDArray[np.float64], **motion: float) -> Iterator[tuple[World, HeightMap]]:
    low, config = float(AXIS[0]), MotionConfig(changes="correction", **motion)
    heightmap = HeightMap(heights, resolution=RESOLUTION, origin=(low, low), motion=config)
    with World(heightmap) as world:
        yield world, heightmap


def spawn(world: World, kind: str, angle: float = 0.0) -> None:
    """A body at rest on a slope in its middle."""
    away = 0.15 if kind != "husky" else 0.14
    state = BodyState(
        (0.013 - math.sin(angle) * away, 0.017, math.cos(angle) * away + 0.013 * math.tan(angle)),
        (0.0, -math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)),
    )
    if kind == "husky":
        world.spawn_robot("body", HUSKY, state)
        for joint in world.bodies["body"].joints:
            world.drive("body", joint, 0.0)
    else:
        world.spawn("body", SHAPES[kind], 5.0, state)


def axis(state: BodyState) -> NDArray[np.float64]:
    """Where the body's own z axis points."""
    return rotation(np.array(state.orientation))[:, 2]


def fastest_and_highest(world: World, steps: int) -> tuple[float, float]:
    fastest, highest = 0.0, -math.inf
    for _ in range(steps):
        world.step()
        state = world.state("body")
        fastest, highest = max(fastest, float(np.linalg.norm(state.linear))), max(highest, state.position[2])
    return fastest, highest


@pytest.mark.parametrize("kind", [*SHAPES, "husky"])
@pytest.mark.parametrize("by", [0.01, 0.3, -0.03, -0.3])
@pytest.mark.parametrize("after", [0.1, 1.0])
def test_a_body_at_rest_goes_with_the_correction(kind: str, by: float, after: float) -> None:
    level = slope(0.0)
    with on_ground(level) as (world, heightmap):
        spawn(world, kind)
        world.step(480)
        heightmap.replace(level, time=world.time)
        world.step(round(240 * after))
        before = world.state("body")
        heightmap.replace(level + by, time=world.time)
        fastest, highest = fastest_and_highest(world, 240)
        rest = before.position[2] + by
        assert fastest < 0.2
        assert highest <= max(rest, before.position[2]) + 0.005
        assert world.state("body").position[2] == pytest.approx(rest, abs=0.001)
        assert axis(world.state("body")) @ axis(before) > math.cos(math.radians(1.0))
        assert world.rescues == 0


@pytest.mark.parametrize("change", [lambda h: h + 0.2, lambda h: h + 0.05 * AXIS, lambda h: h + np.sin(AXIS) * 0.1])
def test_a_correction_changes_no_velocity(change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> None:
    with on_ground(slope(0.1)) as (world, heightmap):
        for index, (name, shape) in enumerate(SHAPES.items()):
            state = BodyState((0.5 * index - 0.5, 0.0, 0.3), linear=(0.1, 0.2, -0.3), angular=(0.3, 0.2, 0.1))
            world.spawn(name, shape, 1.0, state)
        world.track("tracked", 0.1, BodyState((1.0, 1.0, 0.3), linear=(0.1, 0.0, 0.0)))
        world.update()
        before = {name: world.state(name) for name in world.bodies}
        heightmap.replace(change(slope(0.1)), time=0.0)
        world.time = 0.07
        world.update()
        for name, state in before.items():
            after = world.state(name)
            assert (after.linear, after.angular) == (state.linear, state.angular)
            assert (after == state) == (name == "tracked")


def test_a_stack_stays_whole() -> None:
    with on_ground(slope(0.0)) as (world, heightmap):
        spawn(world, "box")
        world.spawn("top", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.013, 0.017, 0.45)))
        world.step(240)
        heightmap.replace(slope(0.0) + 0.3, time=world.time)
        world.step(240)
        assert world.state("top").position[2] == pytest.approx(0.75, abs=0.002)


def test_a_region_takes_only_what_is_on_it() -> None:
    with on_ground(slope(0.0)) as (world, heightmap):
        spawn(world, "box")
        world.spawn("beside", Box(0.3, 0.3, 0.3), 2.0, BodyState((2.0, 0.0, 0.15)))
        world.step(240)
        heightmap.update_region(0, 0, np.full((CELLS, 40), 0.1), time=world.time)
        world.step(240)
        assert world.state("body").position[2] == pytest.approx(0.25, abs=0.001)
        assert world.state("beside").position[2] == pytest.approx(0.15, abs=0.001)


@pytest.mark.parametrize("kind", ["box", "cylinder", "husky"])
def test_fused_noise_leaves_bodies_at_rest(kind: str) -> None:
    """A box on noise rocks between the samples that hold it, as these change by tenths of a millimetre."""
    rng, sigma = np.random.default_rng(2), 0.005
    with on_ground(rng.normal(0.0, sigma, (CELLS, CELLS)), noise=sigma) as (world, heightmap):
        spawn(world, kind)
        fastest = 0.0
        for index in range(60):
            heightmap.replace(rng.normal(0.0, sigma, (CELLS, CELLS)), time=world.time)
            fastest = 0.0 if index < 40 else fastest
            fastest = max(fastest, fastest_and_highest(world, 12)[0])
        assert fastest < (0.1 if kind == "box" else 0.05)
        assert abs(world.state("body").position[2] - (0.0 if kind == "husky" else 0.15)) < 2.0 * sigma


def test_a_body_that_falls_asleep_on_fused_noise_does_not_fall() -> None:
    """While PyBullet stops it, its ground goes on to be corrected: nothing may wake it in PyBullet, where it would fall
    as soon as its collider is taken away."""
    rng, sigma = np.random.default_rng(2), 0.005
    with on_ground(slope(0.0), noise=sigma) as (world, heightmap):
        world.spawn("box", Box(0.4, 0.4, 0.3), 20.0, BodyState((0.0, 0.017, 0.15)))
        asleep = 0
        for _ in range(220):
            heightmap.replace(rng.normal(0.0, sigma, (CELLS, CELLS)), time=world.time)
            for _ in range(12):
                world.step()
                if world.is_asleep("box"):
                    asleep += 1
                    assert world.state("box").linear == (0.0, 0.0, 0.0)
        assert asleep > 1000


@pytest.mark.parametrize("kind", ["box", "husky"])
@pytest.mark.parametrize("by", [0.03, -0.03])
@pytest.mark.parametrize("maps", [1, 4, 40])
def test_a_sleeping_body_follows_corrections_that_noise_could_explain(kind: str, by: float, maps: int) -> None:
    """The fused heights follow the maps slowly, and too little for noise of 3 cm to wake the body; it rises with them,
    and is never deeper than the tolerance, even if no further map comes."""
    with on_ground(slope(0.0), noise=0.03) as (world, heightmap):
        spawn(world, kind)
        world.step(480)
        assert world.is_asleep("body")
        height = world.state("body").position[2]
        for _ in range(maps):
            heightmap.replace(slope(0.0) + by, time=world.time)
            world.step(48)
        world.step(240)
        change = heightmap.at([[0.013, 0.017]], world.time).heights[0]
        assert abs(change) > (0.014 if maps == 1 else 0.02)
        deepest = 1e-3 if kind == "box" else 2.5e-3  # wheels lie 2 mm deeper once a correction has moved them awake
        assert world.state("body").position[2] - height == pytest.approx(change, abs=deepest)
        world.wake()
        world.step(240)
        assert world.state("body").position[2] - height == pytest.approx(change, abs=deepest)


@pytest.mark.parametrize("kind", ["box", "ball"])
@pytest.mark.parametrize("by", [0.03, -0.03])
@pytest.mark.parametrize("half", [1, 2])
def test_a_correction_of_a_part_of_the_ground_under_a_sleeping_body_leaves_it_on_the_ground(
    kind: str, by: float, half: int
) -> None:
    """After one map of noise of 10 mm a second one could explain it; the body is where one is that never slept."""
    middle, places = slice(CELLS // 2 - half, CELLS // 2 + half + 1), []
    for sleep in (True, False):
        low, motion = float(AXIS[0]), MotionConfig(changes="correction", noise=0.01)
        heightmap = HeightMap(slope(0.0), resolution=RESOLUTION, origin=(low, low), motion=motion)
        with World(heightmap, WorldConfig(physics=PhysicsConfig(sleep=sleep))) as world:
            spawn(world, kind)
            world.step(480)
            assert world.is_asleep("body") == sleep
            heights = slope(0.0)
            heights[middle, middle] = by
            heightmap.replace(heights, time=world.time)
            world.step(240)
            places.append(world.state("body").position)
    assert places[0] == pytest.approx(places[1], abs=1e-3)


def test_a_body_goes_with_its_tile_although_another_is_taken_away_at_once() -> None:
    """Whose number among the tiles is another then."""
    motion = MotionConfig(changes="correction")
    level, terrain = slope(0.0), Terrain()
    for name, x in (("first", -10.0), ("second", 0.0), ("third", 10.0)):
        terrain.put(name, HeightMap(level, resolution=RESOLUTION, origin=(x, 0.0), motion=motion))
    with World(terrain) as world:
        world.spawn("body", SHAPES["box"], 5.0, BodyState((3.0, 3.0, 0.15)))
        world.step(240)
        second = terrain.tile("second")
        second.replace(level + 0.3, time=world.time)
        world.step(24)
        depth = world.state("body").position[2] - 0.15 - second.at([[3.0, 3.0]], world.time).heights[0]
        terrain.remove("first")
        fastest, highest = fastest_and_highest(world, 240)
        assert abs(depth) < 0.01
        assert world.rescues == 0
        assert fastest < 0.05
        assert highest == pytest.approx(0.45, abs=0.001)
