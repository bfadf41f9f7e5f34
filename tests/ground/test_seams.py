"""Ground in two pieces, of maps, meshes and decks that are flush, is touched as the same ground in one; and shallow
folds, in one piece and between two, which bodies pass without entering them and rest on."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, Deck, HeightMap, Sphere, Terrain
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests import legged
from tests.bodies import LYING, UPRIGHT, Turn, about_z
from tests.core import mesh_parts
from tests.grounds import terrain_of, world_of
from tests.terrain.surfaces import mesh_of

REACH, ROWS = 4.0, np.arange(-20, 21)  # of the ground to both sides of x = 0 [m], and across [cells]
Form = Callable[[FloatArray, FloatArray], FloatArray]
Piece = Callable[[Form, float, float, float], MainMesh | Deck]  # of a form, from one x to another, in cells of a size


def a_map(form: Form, low: float, high: float, cell: float) -> HeightMap:
    x, y = (cell * each for each in np.meshgrid(np.arange(round(low / cell), round(high / cell) + 1), ROWS))
    return HeightMap(form(x, y), resolution=cell, origin=(low, cell * ROWS[0]))


def a_mesh(form: Form, low: float, high: float, cell: float) -> TriangleMesh:
    return mesh_of(a_map(form, low, high, cell))


def a_deck(form: Form, low: float, high: float, cell: float) -> Deck:
    deck = Deck(a_map(form, low, high, cell), thickness=0.5)
    deck.place((0.0, 0.0, 0.0), UPRIGHT, time=0.0)
    return deck


def pieces(form: Form, *parts: Piece, cell: float = 0.1) -> Terrain:
    """Ground of one piece, or of two."""
    if len(parts) == 1:
        return terrain_of(all=parts[0](form, -REACH, REACH, cell))
    return terrain_of(here=parts[0](form, -REACH, 0.0, cell), there=parts[1](form, 0.0, REACH, cell))


FORMS: dict[str, Form] = {
    "level": lambda x, y: 0.0 * x,
    "waves": lambda x, y: 0.03 * np.sin(2.0 * x + 0.5) * np.cos(1.5 * y),
    "crest": lambda x, y: -0.15 * np.abs(x),
}
LEVEL = FORMS["level"]
Body = tuple[Shape, float, Turn]
BALL, CRATE = (Sphere(0.2), 0.2, UPRIGHT), (Box(0.5, 0.4, 0.3), 0.15, UPRIGHT)
WHEEL = (Cylinder(radius=0.2, height=0.3), 0.2, LYING)
BODIES: list[Body] = [BALL, (Box(0.5, 0.4, 0.3), 0.15, about_z(0.1)), WHEEL]


def a_block(form: Form, low: float, high: float, cell: float) -> TriangleMesh:
    """A closed box whose top is level."""
    return TriangleMesh(*mesh_parts.box((low, -2.0, -0.5), (high, 2.0, 0.0)))


def ride(
    terrain: Terrain, body: Body, form: Form = LEVEL, friction: float = 0.0, speed: float = 1.5, steps: int = 300
) -> FloatArray:
    """Positions of a body that starts at this speed [m/s], 1.2 m before the seam (steps, 3)."""
    shape, up, orientation = body
    start = (-1.2, 0.03, float(form(np.array(-1.2), np.array(0.03))) + up)
    found = []
    with world_of(terrain, friction=friction) as world:
        world.spawn("body", shape, 1.0, BodyState(start, orientation, (speed, 0.0, 0.0)))
        for _ in range(steps):
            world.step()
            found.append(world.state("body").position)
    return np.array(found)


@cache
def ride_on_one(body: Body, form: Form, *more: Any) -> FloatArray:
    """The same on a single map."""
    return ride(pieces(form, a_map), body, form, *more)


def apart(parts: tuple[Piece, Piece], body: Body, form: Form = LEVEL, *more: Any) -> FloatArray:
    """How far a body on two pieces is from one on a single map, after each step [m]."""
    return np.abs(ride(pieces(form, *parts), body, form, *more) - ride_on_one(body, form, *more)).max(1)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_bodies_pass_a_seam_as_if_the_ground_were_one(form: Form, friction: float) -> None:
    """Meshes and maps whose contacts are chosen in another order differ a little on one piece, too."""
    for body in BODIES:
        for parts in [(a_deck, a_map), (a_map, a_deck), (a_mesh, a_map), (a_mesh, a_mesh), (a_mesh, a_deck)]:
            assert apart(parts, body, form, friction).max() < 2e-3, (body[0], parts)


@pytest.mark.parametrize(
    "form",
    [lambda x, y: 0.09 * np.abs(x), lambda x, y: 0.16 * x, lambda x, y: -0.4 * np.maximum(x, 0.0)],
    ids=["fold", "slope", "edge"],
)
@pytest.mark.parametrize("parts", [(a_map, a_deck), (a_deck, a_map), (a_mesh, a_map), (a_deck, a_mesh)])
def test_no_rim_stops_what_comes_fast_to_it(form: Form, parts: tuple[Piece, Piece]) -> None:
    """In the step before it passes the seam, the rim lies ahead of it: beside its way on a slope, and of a sheet that
    falls away behind an edge, the underside."""
    for body in BODIES:
        for speed in (2.8, 3.0, 3.5, 4.0):
            assert apart(parts, body, form, 0.0, speed, 150).max() < 0.02, (body[0], speed)


@pytest.mark.parametrize("there", [a_map, a_block, a_mesh])
def test_a_box_slides_from_a_block_to_what_is_flush_with_it_and_back(there: Piece) -> None:
    """Its front and its back come to the seam at the end of a step."""
    for parts in ((a_block, there), (there, a_block)):
        assert apart(parts, CRATE).max() < 5e-4


@pytest.mark.parametrize("step", [-5e-4, 5e-4, 5e-3])
@pytest.mark.parametrize("there", [a_map, a_mesh])
def test_a_box_passes_steps_of_half_a_millimetre_and_stops_at_larger_ones(there: Piece, step: float) -> None:
    """The first millimetre of a step up is no wall; where pieces overlap, too."""
    for overlap in (0.0, 0.1, -5e-4):
        terrain = pieces(LEVEL, a_deck, there)
        terrain.deck("here").place((overlap, 0.0, -step), UPRIGHT, time=0.0)
        way = ride(terrain, CRATE, lambda x, y: 0.0 * x - step)
        if step < 1e-3:
            assert way[-1, 0] == pytest.approx(-1.2 + 1.5 * 300 / 240, abs=5e-3)
        else:
            assert way[:, 0].max() + 0.25 < 0.05  # where its front tips over the edge


@pytest.mark.parametrize("low", [0.0, -0.2])
@pytest.mark.parametrize("floor", [a_map, a_mesh, a_deck])
def test_a_wall_on_the_floor_stops_what_comes_to_its_foot(floor: Piece, low: float) -> None:
    terrain = pieces(LEVEL, floor)
    terrain.put("wall", TriangleMesh(*mesh_parts.box((0.0, -1.5, low), (1.0, 1.5, 1.0))))
    for body, front in [(BALL, 0.2), (CRATE, 0.25), (WHEEL, 0.2)]:
        way = ride(terrain, body)
        assert way[:, 0].max() + front == pytest.approx(0.0, abs=1e-3), body
        assert np.abs(way[:, 2] - body[1]).max() < 1e-3


@pytest.mark.parametrize("parts", [(a_map, a_mesh), (a_mesh, a_deck), (a_deck, a_map)])
def test_a_humanoid_whose_feet_are_on_a_seam_stands_still(parts: tuple[Piece, Piece]) -> None:
    """The corners of its feet bear it. If crossings of their edges with the rims were chosen in turn, it would rock."""
    with world_of(pieces(LEVEL, *parts), friction=0.8, sleep=False) as world:
        legged.set_up(world, "g1", 0.0, 0.01, 3e-3)
        world.step(720)
        for _ in range(240):
            world.step()
            assert np.linalg.norm(world.state("g1").linear) < 1e-3


ROUND: dict[str, Any] = {  # with their axes along y
    "ball": Sphere(0.1), "marble": Sphere(0.01), "capsule": Capsule(radius=0.1, height=0.2),
    "wheel": Cylinder(radius=0.1, height=0.2),
}  # fmt: skip
PAIRS: list[tuple[Piece, ...]] = [(a_map, a_deck), (a_mesh, a_mesh), (a_mesh, a_map)]


def deepest(terrain: Terrain, body: str, start: float, speed: float) -> float:
    """Depth of the deepest contact of a body that rolls from x = ``start`` over a fold at x = 0 [m]."""
    shape, found = ROUND[body], 0.0
    with world_of(terrain, sleep=False) as world:
        spin = (0.0, speed / shape.radius, 0.0)
        world.spawn("body", shape, 1.0, BodyState((start, 0.033, shape.radius), LYING, (speed, 0.0, 0.0), spin))
        for _ in range(round(240 * 2.0 * abs(start) / speed)):
            world.step()
            found = max([found, *(contact.depth for contact in world.contacts())])
    return found


@pytest.mark.parametrize(
    ("body", "parts"),
    [
        *[(body, (piece,)) for body in ROUND for piece in (a_map, a_mesh, a_deck)],
        *[(body, parts) for body in ("ball", "marble") for parts in PAIRS],
    ],
)
def test_what_rolls_into_a_fold_does_not_enter_it(body: str, parts: tuple[Piece, ...]) -> None:
    """Gravity bends the way of a body below the facet that it rolls on, and the spin of a wheel moves no point of it
    off the ground. Entering the next facet for a step would be 0.4 mm deep at 3 m/s and 0.04 rad. What touches at
    several places prefers those of the step before by a thousandth of its radius."""
    preference = 1e-3 * ROUND[body].bounding_radius if body in ("capsule", "wheel") else 0.0
    for slope, speed in [(0.04, 1.0), (0.04, 3.0), (0.1, 3.0)]:
        terrain = pieces(lambda x, y, slope=slope: slope * np.maximum(x, 0.0), *parts)
        for phase in range(3):
            start = -0.25 + phase / 3 * speed / 240
            assert deepest(terrain, body, start, speed) < 3e-5 + preference, (slope, speed, phase)


@pytest.mark.parametrize(("slope", "cell"), [(0.01, 0.1), (0.04, 0.02)])
@pytest.mark.parametrize("parts", [(a_map,), *PAIRS])
def test_a_marble_touches_the_ground_in_each_step_around_a_near_flat_fold(
    parts: tuple[Piece, ...], slope: float, cell: float
) -> None:
    """A step without a contact is a free fall of 0.17 mm; the fold itself is entered by less than 0.05 mm."""
    terrain = pieces(lambda x, y: slope * np.maximum(x, 0.0), *parts, cell=cell)
    for phase in range(5):
        assert deepest(terrain, "marble", -0.05 + phase / 5 * 0.3 / 240, 0.3) < 6e-5, phase


@pytest.mark.parametrize("piece", [a_map, a_mesh, a_deck])
def test_a_wheel_that_just_touches_the_ground_stays_on_it(piece: Piece) -> None:
    assert deepest(pieces(lambda x, y: 0.0 * x, piece), "wheel", -0.25, 0.3) < 2e-5


def mean_speed_at_rest(seed: int, *parts: Piece) -> float:
    """Mean speed of a box near a ridge of about a degree, two seconds after it was put there [m/s]."""
    rng = np.random.default_rng(seed)
    slope, along, fold = np.tan(np.deg2rad(rng.uniform((-1.0, -1.0, 0.2), (1.0, 1.0, 1.2)))).tolist()
    size, yaw = rng.uniform(0.1, 0.5, 3).tolist(), rng.uniform(-3.0, 3.0)
    at = (rng.uniform(-0.5, 0.5) * size[0], rng.uniform(-0.2, 0.2), 0.5 * size[2] + 0.04)
    terrain = pieces(lambda x, y: slope * x + along * y - fold * np.maximum(x, 0.0), *parts)
    speeds = []
    with world_of(terrain, sleep=False, friction=0.6) as world:
        world.spawn("box", Box(*size), 5.0, BodyState(at, about_z(yaw)))
        world.step(480)
        for _ in range(120):
            world.step()
            state = world.state("box")
            speeds.append(np.linalg.norm(state.linear) + 0.5 * max(size) * np.linalg.norm(state.angular))
    return float(np.mean(speeds))


@pytest.mark.parametrize("parts", [(a_map,), *PAIRS])
def test_boxes_on_near_flat_ridges_come_to_rest(parts: tuple[Piece, ...]) -> None:
    """A ridge between two pieces bears a box also while it rocks beyond the slope of a facet."""
    for seed in (*range(1, 13), 18, 35):
        assert mean_speed_at_rest(seed, *parts) < 2e-3, seed
