"""Shapes on crests, rims, in holes and in impacts: what is solid stays outside the ground, and nothing gains energy."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, Ground, HeightMap, PhysicsConfig, Sphere
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.config import set_up
from smartmesh_ros.ground.shapes import Hull, Shape, Solid
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import LYING, put, random_turn, reach, rotation
from tests.core.contact_cases import contacts_of, random_rotation
from tests.grounds import end_of, energy_of, level, shaped, world_of

RATE = 240.0
TOP, MIDDLE = 0.6, 12  # height of the crest [m], and its column
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
# Heights of the rows of a map whose crest is in the middle [cells -> m].
COLUMNS = np.arange(25) - MIDDLE
CRESTS = {
    "step": np.where(COLUMNS <= 0, TOP, 0.0),
    "ridge": np.where(COLUMNS == 0, TOP, 0.0),
    "rim": np.full(MIDDLE + 1, TOP),
    "hole": np.where((COLUMNS <= 0) | (COLUMNS > 9), TOP, np.nan),
    "blade": TOP - 0.15 * np.abs(COLUMNS),  # in cells of 5 cm, so that flanks rise by 3
}


def crest(form: str, rows: int) -> HeightMap:
    """A map whose crest lies along y at x = 0."""
    return HeightMap(np.tile(CRESTS[form], (rows, 1)), resolution=0.05, origin=(-0.05 * MIDDLE, 0.0))


def planes_of(points: FloatArray) -> FloatArray:
    """Returns the outward unit normals and offsets (F, 4) of the faces of a hull, by brute force."""
    found = []
    for three in itertools.combinations(points, 3):
        normal = np.cross(three[1] - three[0], three[2] - three[0])
        if (length := np.linalg.norm(normal)) < 1e-9:
            continue
        ways = (normal / length, -normal / length)
        found.extend((*way, three[0] @ way) for way in ways if np.all(points @ way <= three[0] @ way + 1e-9))
    return np.array(found)


def leaning(points: FloatArray, rng: np.random.Generator, form: str) -> tuple[FloatArray, FloatArray]:
    """Returns place and orientation at which a shape leans over a crest along y at x = 0, just above the ground."""
    roll, yaw = rng.normal(0.0, rng.choice([0.0, 3e-3, 0.3]), 2)
    turn = np.array(pb.getQuaternionFromEuler((roll, rng.uniform(0.1, 1.2), yaw)))
    at = np.array([rng.uniform(-0.1, 0.1), 0.0, TOP + 0.4])
    heights = np.nan_to_num(CRESTS[form], nan=0.0)
    crest = np.column_stack([np.zeros(101), np.linspace(-0.5, 0.5, 101), np.full(101, TOP)])
    planes = planes_of(points)

    def is_in_ground() -> bool:
        corners = points @ rotation(turn).T + at
        ground = np.interp(corners[:, 0], 0.05 * COLUMNS[: len(heights)], heights, right=0.0)
        return bool(np.any(corners[:, 2] < ground)) or depth_of(crest, planes, at, turn) > -1e-3

    while not is_in_ground():
        at[2] -= 5e-3
    return at + (0.0, 0.0, 5e-3), turn


def depth_of(line: FloatArray, planes: FloatArray, at: FloatArray, turn: FloatArray) -> float:
    """Returns how deep a point of a line (N, 3) is in a hull [m]."""
    inside = (line - at) @ rotation(turn) @ planes[:, :3].T - planes[:, 3]
    return float(-inside.max(axis=1).min())


@pytest.mark.parametrize("speed", [0.0, 6.0])
@pytest.mark.parametrize("is_box", [True, False])
@pytest.mark.parametrize("form", CRESTS)
def test_crests_stay_outside_shapes_that_lean_over_them(client: Any, form: str, is_box: bool, speed: float) -> None:
    """At most 1 mm, of 12 boxes or sharp hulls each, also where they slide at a ``speed`` [m/s] and turn."""
    rng = np.random.default_rng(len(form) + is_box)
    set_up(client, PhysicsConfig(rate=RATE))
    ground = Ground(client, crest(form, 360))
    bodies = []
    for y in 1.0 + 1.4 * np.arange(12):
        half = np.array([rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.3), rng.uniform(0.02, 0.15)])
        points = CORNERS * half
        if not is_box:
            points = rng.normal(size=(10, 3))
            points = points / np.linalg.norm(points, axis=1)[:, None] * half
        at, turn = leaning(points, rng, form)
        shape: Solid = Box(*(2.0 * half)) if is_box else Hull(tuple(map(tuple, points)))
        body = put(client, shape, at + (0.0, y, 0.0), baseOrientation=turn)
        client.changeDynamics(body, -1, lateralFriction=rng.choice([0.0, 0.5]), collisionMargin=1e-4)
        if speed > 0.0:
            way = rotation(turn) @ (speed, 0.0, 0.0)
            client.resetBaseVelocity(body, way.tolist(), rng.normal(0.0, speed, 3).tolist())
        ground.attach(body, shape=shape)
        line = np.column_stack([np.zeros(81), np.linspace(y - 0.5, y + 0.5, 81), np.full(81, TOP)])
        bodies.append((body, line, planes_of(points)))
    deepest = 0.0
    for step in range(60 if speed > 0.0 else 150):
        ground.step(step / RATE, 1.0 / RATE)
        for body, line, planes in bodies:
            at, turn = (np.array(part) for part in client.getBasePositionAndOrientation(body))
            deepest = max(deepest, depth_of(line, planes, at, turn))
    assert deepest < 1e-3


@pytest.mark.parametrize("length", [0.2, 0.37])
def test_boxes_slide_straight_down_a_blade_as_their_upper_edges_leave_it(length: float) -> None:
    """By g sin(slope) t, without friction, from where they lie on a flank that rises by 3, across its crest."""
    slope, half = np.arctan(3.0), 0.05
    down, out = np.array([np.cos(slope), 0.0, -np.sin(slope)]), np.array([np.sin(slope), 0.0, np.cos(slope)])
    turn = pb.getQuaternionFromEuler((0.0, slope, 0.0))
    for above in np.linspace(0.01, 0.05, 9):  # of the upper edge over the crest [m]
        start = np.array([0.0, 1.0, TOP]) + down * (0.5 * length - above) + out * (half - 1e-5)
        box, state = Box(length, 0.2, 2.0 * half), BodyState(tuple(start.tolist()), turn)
        state = end_of(crest("blade", 40), box, state, 40, sleep=False, friction=0.0)
        g_along, time = 9.81 * np.sin(slope), 40 / RATE
        assert np.allclose(state.linear, down * g_along * time, atol=0.02)
        assert np.allclose(state.position, start + down * 0.5 * g_along * time * (time + 1.0 / RATE), atol=1e-3)


@pytest.mark.parametrize("cell", [1e-3, 1e-2])
@pytest.mark.parametrize("size", [3e-4, 1e-3, 5e-3])
def test_boxes_of_any_size_come_to_rest_on_a_face(size: float, cell: float) -> None:
    start = BodyState((0.3 * cell, 0.3 * cell, 2.0 * size))
    state = end_of(level(41, cell), Box(size, size, size), start, 360, 1e-3, sleep=False)
    up = np.abs(rotation(state.orientation)[2])
    assert up.max() > 1.0 - 1e-6
    assert state.position[2] - 0.5 * size * up.sum() == pytest.approx(-1e-5, abs=5e-6)


def lowest(shape: Shape, state: BodyState) -> float:
    """Returns the height of the lowest point of a body [m]."""
    return state.position[2] - reach(shape, rotation(state.orientation)[2])


# Shapes, their distance [m], and how deep they may be [m] for how many steps. An impact at one end of a thin part
# turns it by half a radian in a step, and the other end comes down.
THROWN: dict[str, tuple[Shape, float, float, int]] = {
    "large coin": (Cylinder(radius=0.5, height=0.05), 8.0, 1e-3, 0),
    "long rod": (Box(1.6, 0.1, 0.1), 8.0, 1e-3, 1),
    "coin": (Cylinder(radius=0.03, height=0.003), 1.0, 2e-3, 3),
    "disc": (Cylinder(radius=0.008, height=0.004), 1.0, 2e-3, 3),
    "rod": (Box(0.06, 0.003, 0.006), 1.0, 2e-3, 3),
    "plate": (Box(0.07, 0.07, 0.002), 1.0, 2e-3, 3),
}


@pytest.mark.parametrize("name", THROWN)
def test_impacts_of_shapes_that_turn_are_not_deep(name: str) -> None:
    """Of 16 throws onto level ground, at 2 to 17 m/s and up to 17 rad/s; none comes to be below it."""
    shape, apart, most, steps = THROWN[name]
    rng = np.random.default_rng(2)
    with world_of(HeightMap(np.zeros((41, 41)), resolution=0.1 * apart), sleep=False) as world:
        for k in range(16):
            turn = tuple(random_turn(rng))
            place = (apart * (0.5 + k % 4), apart * (0.5 + k // 4), 0.3 if apart < 2.0 else 1.5)
            linear = (*rng.uniform(-2.0, 2.0, 2), rng.uniform(-6.0, -2.0) * (1.0 if apart < 2.0 else 2.0))
            state = BodyState(place, turn, linear, tuple(rng.uniform(-10.0, 10.0, 3)))
            world.spawn(f"{k}", shape, 0.1, state)
        deep = np.zeros(16, int)
        for _ in range(240):
            world.step()
            deep = np.where([lowest(shape, world.state(each)) < -most for each in world.bodies], deep + 1, 0)
            assert deep.max() <= steps
        assert world.rescues == 0


@pytest.mark.parametrize("depth", [2e-3, 7e-3, 13e-3])
@pytest.mark.parametrize("shape", [Sphere(0.2), Box(0.4, 0.4, 0.4)], ids=["ball", "box"])
def test_what_bounces_out_of_the_ground_is_no_faster_than_it_came(shape: Shape, depth: float) -> None:
    start = BodyState((0.01, 0.02, 0.2 - depth), linear=(0.0, 0.0, -1.0))
    assert 0.7 < end_of(level(), shape, start, 1, sleep=False, restitution=0.8).linear[2] < 1.0


@pytest.mark.parametrize("rise", [0.2, 0.4])
@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_rim_is_touched_wherever_its_samples_are(rise: float, yaw: float) -> None:
    """A plate leans over the rim of a plane, which rises to the rim and along it; its samples move along the rim."""
    cell, along = 0.25, 0.2
    shape, found = BodyShape.box((0.1, 0.1, 0.01)), []
    leans, turns = (tuple(pb.getQuaternionFromEuler(angles)) for angles in ((along, 0.1 - rise, 0.0), (0.0, 0.0, yaw)))
    turn = rotation(leans) @ rotation(turns)
    for shift in np.linspace(0.0, cell, 11):
        y, x = cell * np.mgrid[-10:11, -10:1]
        heights = np.tan(along) * (y + shift) + rise * x
        plane = HeightMap(heights, resolution=cell, origin=(-10.0 * cell, shift - 10.0 * cell))
        contacts = contacts_of(shape, plane, turn, turn @ (0.0, 0.0, 0.003), 1e-3)
        found.append(contacts[:, 6].min(initial=0.0))
    assert found == pytest.approx(np.full(11, found[0]), abs=1e-6)
    assert found[0] <= -2e-3


@pytest.mark.parametrize("form", ["rim", "hole"])
def test_plates_that_fall_over_a_rim_gain_no_energy(form: str) -> None:
    """Without friction, from the rim down beside the wall under it."""
    rng = np.random.default_rng(1)
    count = 10
    with world_of(crest(form, 360), sleep=False, friction=0.0) as world:
        for k in range(count):
            turn = pb.getQuaternionFromEuler(rng.normal(0.0, 0.3, 3).tolist())
            place, linear = (rng.uniform(-0.15, 0.15), 1.0 + 1.5 * k, TOP + 0.25), (rng.uniform(0.0, 1.0), 0.0, 0.0)
            world.spawn(f"{k}", Box(0.4, 0.4, 0.03), 1.0, BodyState(place, turn, linear))
        before = [energy_of(world, f"{k}") for k in range(count)]
        gained = np.zeros(count)
        for _ in range(240):
            world.step()
            now = [energy_of(world, f"{k}") for k in range(count)]
            gained = np.maximum(gained + np.subtract(now, before), 0.0)
            before = now
            assert gained.max() < 0.05  # [J]


# Which samples at x, y [m] are no ground.
HOLES: dict[str, Callable[[FloatArray, FloatArray], Any]] = {
    "from x = 0 on": lambda x, y: x > 0.01,
    "slot": lambda x, y: (x > 0.01) & (x < 0.99) & (abs(y) < 0.29),  # 0.6 m wide, but for a facet in each corner
    "pit": lambda x, y: (abs(x) < 0.19) & (abs(y) < 0.19),  # 0.4 m wide
    "trench": lambda x, y: abs(x) < 0.09,  # 0.2 m wide
}
# What stands where, and the height of its middle at rest [m]; NaN = it falls in.
BOX, WHEEL = Box(0.6, 0.36, 0.3), Cylinder(radius=0.2, height=0.3)
CASES: dict[str, tuple[str, Shape, BodyState, float]] = {
    "box over a slot, between two rims": ("slot", BOX, BodyState((0.08, 0.0, 0.15)), math.nan),
    "box before a slot": ("slot", BOX, BodyState((-0.08, 0.0, 0.15)), 0.15),
    "box longer than a trench is wide": ("trench", BOX, BodyState((0.01, 0.0, 0.15)), 0.15),
    "ball in a pit": ("pit", Sphere(0.3), BodyState((0.01, 0.01, 0.3)), math.sqrt(0.3**2 - 0.2**2)),
    "wheel in a trench": ("trench", WHEEL, BodyState((0.01, 0.013, 0.2), LYING), math.sqrt(0.2**2 - 0.1**2)),
    "wheel over the rim": ("from x = 0 on", WHEEL, BodyState((0.03, 0.013, 0.2), LYING), math.nan),
}


@pytest.mark.parametrize("name", ["ball", "box", "capsule"])
def test_neighbours_that_share_no_facet_are_apart(name: str) -> None:
    """Two parts of a map meet at one sample each: the contacts with both are those with each of them alone."""
    rng, touched = np.random.default_rng(len(name)), 0
    ball, box = BodyShape.ball(0.2), BodyShape.box((0.4, 0.2, 0.1))
    shape = {"ball": ball, "box": box, "capsule": BodyShape.capsule(0.1, 0.4)}[name]
    rows, columns = np.mgrid[:12, :12]
    for _ in range(200):
        heights = rng.normal(scale=0.02, size=(12, 12))
        heights[(rows == 5) & (columns != 5) | (rows == 6) & (columns != 5 + rng.integers(2))] = np.nan
        turn, at, found = random_rotation(rng), (*rng.uniform(0.4, 0.7, 2), rng.uniform(0.1, 0.25)), []
        for part in (rows >= 0, rows < 6, rows >= 6):
            ground = HeightMap(np.where(part, heights, np.nan), resolution=0.1)
            found.append(sorted(contacts_of(shape, ground, turn, at, 1e-2).tolist()))
        touched += len(found[0])
        assert found[0] == sorted(found[1] + found[2])
    assert touched > 100


@pytest.mark.parametrize("name", CASES)
def test_rims_hold_what_stands_on_them_and_holes_nothing(name: str) -> None:
    """For 2 s on level ground with a hole."""
    hole, shape, start, rest = CASES[name]
    height = end_of(shaped(lambda x, y: np.where(HOLES[hole](x, y), np.nan, 0.0), 61), shape, start, 480).position[2]
    assert height < -1.0 if math.isnan(rest) else height == pytest.approx(rest, abs=2e-3)
