"""Bodies are taken along by corrections of the ground under them, and gain nothing by it."""

import math
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Carrier, Deck, HeightMap, MotionConfig, World
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import rotation
from tests.core import mesh_parts
from tests.grounds import level, moving, shaped, terrain_of, world_of
from tests.urdfs import HUSKY, box, link, robot

CELLS = 61
FLAT = np.zeros((CELLS, CELLS))
CORRECTED = MotionConfig(changes="correction")
SHAPES: dict[str, Shape] = {
    "box": Box(0.4, 0.4, 0.3), "ball": Sphere(0.15), "cylinder": Cylinder(radius=0.2, height=0.3),
}  # fmt: skip


def corrected(noise: float = 0.0) -> HeightMap:
    return level(CELLS, motion=MotionConfig(changes="correction", noise=noise))


def spawn(world: World, kind: str, x: float = 0.013, y: float = 0.017) -> None:
    """A body at rest, called by its kind."""
    if kind == "husky":
        world.spawn_robot("husky", HUSKY, BodyState((x, y, 0.14)))
        for joint in world.bodies["husky"].joints:
            world.drive("husky", joint, 0.0)
    else:
        world.spawn(kind, SHAPES[kind], 5.0, BodyState((x, y, 0.15)))


def heights_of(world: World) -> FloatArray:
    return np.array([world.state(name).position[2] for name in world.bodies])


def fastest_of(world: World) -> float:
    return max(math.hypot(*world.state(name).linear) for name in world.bodies)


@pytest.mark.parametrize("by", [0.01, 0.3, -0.03, -0.3])
def test_bodies_at_rest_go_with_the_correction_of_the_region_that_they_are_on(by: float) -> None:
    """A stack and a robot whole, upright and without a throw; who is beside the region stays."""
    heightmap = corrected()
    with World(heightmap) as world:
        for kind, x in (("box", -1.5), ("ball", -0.8), ("cylinder", 0.0)):
            spawn(world, kind, x, -1.5)
        spawn(world, "husky", -1.0, 0.5)
        world.spawn("top", Box(0.3, 0.3, 0.3), 2.0, BodyState((-1.5, -1.5, 0.45)))
        moved = len(world.bodies)
        world.spawn("beside", Box(0.3, 0.3, 0.3), 2.0, BodyState((2.0, 0.0, 0.15)))
        world.step(480)
        heightmap.replace(FLAT, time=world.time)
        world.step(24)
        before = heights_of(world)
        rest = before + by * (np.arange(len(before)) < moved)
        heightmap.update_region(0, 0, np.full((CELLS, 40), by), time=world.time)
        for _ in range(240):
            world.step()
            assert fastest_of(world) < 0.2
            assert (heights_of(world) <= np.maximum(rest, before) + 0.005).all()
        assert heights_of(world) == pytest.approx(rest, abs=0.002)
        for name in world.bodies:
            assert rotation(np.array(world.state(name).orientation))[2, 2] > math.cos(math.radians(1.0))
        assert world.rescues == 0


@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_a_correction_changes_no_velocity(tilt: float) -> None:
    heightmap = shaped(lambda x, y: 0.1 * x, CELLS, motion=CORRECTED)
    with World(heightmap) as world:
        for index, (name, shape) in enumerate(SHAPES.items()):
            state = BodyState((0.5 * index - 0.5, 0.0, 0.3), linear=(0.1, 0.2, -0.3), angular=(0.3, 0.2, 0.1))
            world.spawn(name, shape, 1.0, state)
        world.track("tracked", 0.1, BodyState((1.0, 1.0, 0.3), linear=(0.1, 0.0, 0.0)))
        world.update()
        before = {name: world.state(name) for name in world.bodies}
        heightmap.replace(heightmap.heights * (1.0 + 10.0 * tilt) + 0.2, time=0.0)
        world.time = 0.07
        world.update()
        for name, state in before.items():
            after = world.state(name)
            assert (after.linear, after.angular) == (state.linear, state.angular)
            assert (after == state) == (name == "tracked")


@pytest.mark.parametrize("kind", ["box", "cylinder", "husky"])
def test_fused_noise_leaves_bodies_at_rest(kind: str) -> None:
    """A box on noise rocks between the samples that hold it, as these change by tenths of a millimetre."""
    rng, sigma = np.random.default_rng(2), 0.005
    heightmap = corrected(sigma)
    with World(heightmap) as world:
        spawn(world, kind)
        for index in range(60):
            heightmap.replace(rng.normal(0.0, sigma, FLAT.shape), time=world.time)
            for _ in range(12):
                world.step()
                assert index < 40 or fastest_of(world) < (0.1 if kind == "box" else 0.05)
        assert abs(heights_of(world)[0] - (0.0 if kind == "husky" else 0.15)) < 2.0 * sigma


@pytest.mark.parametrize("kind", ["box", "husky"])
@pytest.mark.parametrize("by", [0.03, -0.03])
@pytest.mark.parametrize("maps", [1, 40])
def test_a_sleeping_body_follows_corrections_that_noise_could_explain(kind: str, by: float, maps: int) -> None:
    """The fused heights follow the maps slowly, and too little for noise of 3 cm to wake the body; it rises with them,
    and is never deeper than the tolerance, even if no further map comes."""
    heightmap = corrected(0.03)
    with World(heightmap) as world:
        spawn(world, kind)
        world.step(480)
        assert world.is_asleep(kind)
        height = heights_of(world)[0]
        for _ in range(maps):
            heightmap.replace(FLAT + by, time=world.time)
            world.step(48)
        world.step(240)
        change = heightmap.at([[0.013, 0.017]], world.time).heights[0]
        assert abs(change) > (0.014 if maps == 1 else 0.02)
        deepest = 1e-3 if kind == "box" else 2.5e-3  # wheels lie 2 mm deeper once a correction has moved them awake
        assert heights_of(world)[0] - height == pytest.approx(change, abs=deepest)
        world.wake()
        world.step(240)
        assert heights_of(world)[0] - height == pytest.approx(change, abs=deepest)


@pytest.mark.parametrize("kind", ["box", "ball"])
@pytest.mark.parametrize("by", [0.03, -0.03])
def test_a_correction_of_a_part_of_the_ground_under_a_sleeping_body_leaves_it_on_the_ground(
    kind: str, by: float
) -> None:
    """After one map of noise of 10 mm a second one could explain it; the body is where one is that never slept."""
    places = []
    for sleep in (True, False):
        heightmap = corrected(0.01)
        with world_of(heightmap, sleep=sleep) as world:
            spawn(world, kind)
            world.step(480)
            assert world.is_asleep(kind) == sleep
            heights = FLAT.copy()
            heights[29:32, 29:32] = by
            heightmap.replace(heights, time=world.time)
            world.step(240)
            places.append(world.state(kind).position)
    assert places[0] == pytest.approx(places[1], abs=1e-3)


def test_a_body_goes_with_its_tile_although_another_is_taken_away_at_once() -> None:
    """Whose number among the tiles is another then."""
    first, second = (HeightMap(FLAT, resolution=0.1, origin=(x, 0.0), motion=CORRECTED) for x in (-10.0, 0.0))
    terrain = terrain_of(first=first, second=second)
    with World(terrain) as world:
        spawn(world, "box", 3.0, 3.0)
        world.step(240)
        second.replace(FLAT + 0.3, time=world.time)
        world.step(24)
        depth = world.state("box").position[2] - 0.15 - second.at([[3.0, 3.0]], world.time).heights[0]
        terrain.remove("first")
        world.step(240)
        assert abs(depth) < 0.01
        assert world.rescues == 0
        assert world.state("box").position[2] == pytest.approx(0.45, abs=0.001)


def ways_with(world: World, ground: HeightMap, by: float) -> dict[str, FloatArray]:
    """Return the way [m] of each body by which a correction of ``ground`` moves it, without a kick."""
    before = {name: np.array(world.state(name).position) for name in world.bodies}
    ground.replace(FLAT + by, time=world.time)
    for _ in range(240):
        world.step()
        assert fastest_of(world) < 0.25
    return {name: np.array(world.state(name).position) - place for name, place in before.items()}


@pytest.mark.parametrize("by", [0.1, -0.1])
@pytest.mark.parametrize(("height", "tilt"), [(2.0, 0.0), (2.0, 0.1), (0.6, 0.0), (0.6, 0.1)])
@pytest.mark.parametrize("sleep", [False, True])
def test_bodies_go_with_corrections_of_the_deck_that_they_are_on_and_of_no_other_ground(
    by: float, height: float, tilt: float, sleep: bool
) -> None:
    """A stack is on the deck, a box on the road below it."""
    orientation = (math.sin(0.5 * tilt), 0.0, 0.0, math.cos(0.5 * tilt))
    tile, road, up = corrected(), corrected(), rotation(np.array(orientation))[:, 2]
    deck = Deck(tile, thickness=0.2, position=(0.0, 0.0, height), orientation=orientation)
    with world_of(terrain_of(road=road, deck=deck), sleep=sleep) as world:
        for name, over in (("above", 0.15), ("top", 0.45)):
            place = np.array([0.0, 0.0, height]) + over * up
            world.spawn(name, SHAPES["box"], 5.0, BodyState(tuple(place), orientation))
        spawn(world, "box")
        for ground, moved, normal in ((tile, ["above", "top"], up), (road, ["box"], np.array([0.0, 0.0, 1.0]))):
            world.step(480)
            assert {world.is_asleep(name) for name in world.bodies} == {sleep}
            for name, way in ways_with(world, ground, by).items():
                assert way == pytest.approx(by * normal * (name in moved), abs=1e-3 if name in moved else 1e-4)
        assert world.rescues == 0


@pytest.mark.parametrize("by", [0.1, -0.1])
@pytest.mark.parametrize("sleep", [False, True])
def test_what_lies_on_a_deck_goes_with_the_body_that_carries_the_deck(by: float, sleep: bool) -> None:
    """A raft goes with the correction of the ground that it lies on, a tracked body does not."""
    ground = corrected()
    terrain = terrain_of(ground=ground, bed=Deck(level(9), thickness=0.1), tray=Deck(level(9), thickness=0.1))
    with world_of(terrain, sleep=sleep) as world:
        world.spawn("raft", Box(0.8, 0.8, 0.3), 20.0, BodyState((-1.5, 0.0, 0.15)))
        world.carry("bed", Carrier("raft", position=(0.0, 0.0, 0.16)))
        world.track("hand", 0.1, BodyState((1.5, 0.0, 0.15)))
        world.carry("tray", Carrier("hand", position=(0.0, 0.0, 0.16)))
        for name, x in (("on the bed", -1.5), ("on the tray", 1.5)):
            world.spawn(name, SHAPES["box"], 5.0, BodyState((x, 0.0, 0.46)))
        world.step(480)
        for name, way in ways_with(world, ground, by).items():
            assert way == pytest.approx((0.0, 0.0, by * (name in ("raft", "on the bed"))), abs=2e-3)
        assert world.rescues == 0


def bridged(road: HeightMap, on: str, **physics: Any) -> World:
    """A world of a road and a bridge over it: a mesh, also of the deck whose map is the road, or a tracked body. A box
    is on the bridge, and one below."""
    bridge = TriangleMesh(*mesh_parts.box((-1.0, -1.0, 0.5), (1.0, 1.0, 0.6)))
    terrain = terrain_of(road=Deck(road) if on == "mesh of a deck" else road)
    if on == "mesh":
        terrain.put("bridge", bridge)
    elif on == "mesh of a deck":
        terrain.deck("road").put("bridge", bridge)
    world = world_of(terrain, **physics)
    if on == "tracked body":
        world.track("bridge", Box(2.0, 2.0, 0.1), BodyState((0.0, 0.0, 0.55)))
    for name, z in (("above", 0.75), ("below", 0.15)):
        world.spawn(name, SHAPES["box"], 5.0, BodyState((0.0, 0.0, z)))
    return world


@pytest.mark.parametrize("by", [0.1, -0.1])
@pytest.mark.parametrize("sleep", [False, True])
@pytest.mark.parametrize("on", ["mesh", "mesh of a deck", "tracked body"])
def test_what_lies_close_above_the_ground_on_what_stays_goes_with_no_correction(
    by: float, sleep: bool, on: str
) -> None:
    """A stack is on the bridge, a box on the road below it, another one beside it."""
    road = corrected()
    with bridged(road, on, sleep=sleep) as world:
        for name, x, z in (("top", 0.0, 1.05), ("beside", 2.0, 0.15)):
            world.spawn(name, SHAPES["box"], 5.0, BodyState((x, 0.0, z)))
        world.step(480)
        for name, way in ways_with(world, road, by).items():
            moves = name in ("below", "beside")
            assert way == pytest.approx((0.0, 0.0, by * moves), abs=1e-3 if moves else 1e-4)
        assert world.rescues == 0


@pytest.mark.parametrize("on", ["mesh", "tracked body"])
def test_what_sleeps_on_what_stays_goes_with_no_correction_that_noise_could_explain(on: str) -> None:
    road = corrected(0.001)
    with bridged(road, on) as world:
        world.step(480)
        assert world.is_asleep("above") and world.is_asleep("below")
        ways = ways_with(world, road, 0.002)
        assert world.is_asleep("above") and world.is_asleep("below")
        assert ways["below"][2] > 5e-4
        assert ways["above"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("by", [0.1, -0.1])
def test_what_stands_on_the_ground_astride_something_that_stays_goes_with_the_correction(by: float) -> None:
    road = corrected()
    foot = f"<geometry>{box((0.1, 0.1, 0.3))}</geometry>"
    places = [(x, y) for x in (-0.3, 0.3) for y in (-0.3, 0.3)]
    legs = "".join(f'<collision><origin xyz="{x} {y} -0.2"/>{foot}</collision>' for x, y in places)
    with World(road) as world:
        world.track("stone", Box(0.2, 0.2, 0.2), BodyState((0.0, 0.0, 0.1)))
        world.spawn_robot(
            "table", robot(link("top", box((0.7, 0.7, 0.1)), 5.0, 0.5, legs)), BodyState((0.0, 0.0, 0.35))
        )
        world.step(240)
        ways = ways_with(world, road, by)
        assert ways["table"] == pytest.approx((0.0, 0.0, by), abs=1e-3)
        assert world.rescues == 0


def test_a_wide_box_keeps_its_contacts_where_the_ground_flickers() -> None:
    """Else its friction would start anew, and its weight shift, with each map."""
    rng, changes, before = np.random.default_rng(1), 0, None
    with World(corrected()) as world:
        world.spawn("box", Box(2.0, 2.0, 0.2), 10.0, BodyState((0.0, 0.0, 0.1)))
        for step in moving(world, lambda _: rng.uniform(-1e-4, 1e-4, FLAT.shape), 240):
            contacts = sorted(tuple(np.round(contact.position[:2], 2) + 0.0) for contact in world.contacts())
            changes += step > 60 and contacts != before
            before = contacts
    assert changes < 30
