"""Ground in two pieces, of maps, meshes and decks that are flush, is touched as the same ground in one."""

from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, Deck, HeightMap, Sphere, Terrain
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.joints import JointCommand
from tests import legged
from tests.core import mesh_parts
from tests.grounds import terrain_of, world_of

RESOLUTION = 0.1
ALONG_X = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
TURNED = (0.0, 0.0, np.sin(0.05), np.cos(0.05))
Form = Callable[[FloatArray, FloatArray], FloatArray]
Piece = Callable[[Form, float, float], MainMesh | Deck]  # of a form, from one x to another
FORMS: dict[str, Form] = {
    "level": lambda x, y: 0.0 * x,
    "waves": lambda x, y: 0.03 * np.sin(2.0 * x + 0.5) * np.cos(1.5 * y),
    "crest": lambda x, y: -0.15 * np.abs(x),
}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
BODIES = [
    (Sphere(0.2), 0.2, UPRIGHT),
    (Box(0.5, 0.4, 0.3), 0.15, TURNED),
    (Cylinder(radius=0.2, height=0.3), 0.2, ALONG_X),
]
CRATE = (Box(0.5, 0.4, 0.3), 0.15, UPRIGHT)


def a_map(form: Form, low: float, high: float) -> HeightMap:
    x, y = np.meshgrid(np.arange(round(low / RESOLUTION), round(high / RESOLUTION) + 1), np.arange(-20, 21))
    return HeightMap(form(RESOLUTION * x, RESOLUTION * y), resolution=RESOLUTION, origin=(low, -2.0))


def a_mesh(form: Form, low: float, high: float) -> TriangleMesh:
    middle = 0.5 * (low + high)
    vertices, triangles = mesh_parts.sheet(
        high - low, round((high - low) / RESOLUTION), lambda x, y: form(x + middle, y)
    )
    return TriangleMesh(vertices + [middle, 0.0, 0.0], triangles)


def a_deck(form: Form, low: float, high: float) -> Deck:
    deck = Deck(a_map(form, low, high), thickness=0.5)
    deck.place((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), time=0.0)
    return deck


def a_block(form: Form, low: float, high: float) -> TriangleMesh:
    """A closed box whose top is level."""
    return TriangleMesh(*mesh_parts.box((low, -2.0, -0.5), (high, 2.0, 0.0)))


def ride(
    terrain: Terrain, body: tuple[Shape, float, tuple[float, ...]], form: Form, friction: float, speed: float = 1.5
) -> FloatArray:
    """Positions of a body that starts at this speed [m/s], 1.2 m before the seam (steps, 3)."""
    shape, up, orientation = body
    start = (-1.2, 0.03, float(form(np.array(-1.2), np.array(0.03))) + up)
    found = []
    with world_of(terrain, friction=friction) as world:
        world.spawn("body", shape, 1.0, BodyState(start, orientation, (speed, 0.0, 0.0)))
        for _ in range(300):
            world.step()
            found.append(world.state("body").position)
    return np.array(found)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_bodies_pass_a_seam_as_if_the_ground_were_one(form: Form, friction: float) -> None:
    """Meshes and maps whose contacts are chosen in another order differ a little on one piece, too."""
    for body in BODIES:
        one = ride(Terrain(a_map(form, -4.0, 4.0)), body, form, friction)
        for here, there in [(a_deck, a_map), (a_map, a_deck), (a_mesh, a_map), (a_mesh, a_mesh), (a_mesh, a_deck)]:
            two = ride(terrain_of(here=here(form, -4.0, 0.0), there=there(form, 0.0, 4.0)), body, form, friction)
            assert np.abs(two - one).max() < 2e-3, (body[0], here, there)


@pytest.mark.parametrize(
    "form",
    [lambda x, y: 0.09 * np.abs(x), lambda x, y: 0.16 * x, lambda x, y: -0.4 * np.maximum(x, 0.0)],
    ids=["fold", "slope", "edge"],
)
@pytest.mark.parametrize(("here", "there"), [(a_map, a_deck), (a_deck, a_map), (a_mesh, a_map), (a_deck, a_mesh)])
def test_no_rim_stops_what_comes_fast_to_it(form: Form, here: Piece, there: Piece) -> None:
    """In the step before it passes the seam, the rim lies ahead of it: beside its way on a slope, and of a sheet that
    falls away behind an edge, the underside."""
    for body in BODIES:
        for speed in (2.8, 3.0, 3.5, 4.0):
            one = ride(Terrain(a_map(form, -4.0, 4.0)), body, form, 0.0, speed)
            two = ride(terrain_of(here=here(form, -4.0, 0.0), there=there(form, 0.0, 4.0)), body, form, 0.0, speed)
            assert np.abs(two - one)[:150].max() < 0.02, (body[0], speed)


@pytest.mark.parametrize(
    ("here", "there"), [(a_block, a_map), (a_map, a_block), (a_block, a_block), (a_block, a_mesh), (a_mesh, a_block)]
)
def test_a_box_slides_from_a_block_to_what_is_flush_with_it(here: Piece, there: Piece) -> None:
    """Its front and its back come to the seam at the end of a step."""
    form = FORMS["level"]
    way = ride(terrain_of(here=here(form, -4.0, 0.0), there=there(form, 0.0, 4.0)), CRATE, form, 0.0)
    assert np.abs(way - ride(Terrain(a_map(form, -4.0, 4.0)), CRATE, form, 0.0)).max() < 5e-4


@pytest.mark.parametrize("step", [-5e-4, 5e-4, 5e-3])
@pytest.mark.parametrize("there", [a_map, a_mesh])
def test_a_box_passes_steps_of_half_a_millimetre_and_stops_at_larger_ones(there: Piece, step: float) -> None:
    """The first millimetre of a step up is no wall; where pieces overlap, too."""
    for overlap in (0.0, 0.1, -5e-4):
        deck = a_deck(FORMS["level"], -4.0, 0.0)
        deck.place((overlap, 0.0, -step), (0.0, 0.0, 0.0, 1.0), time=0.0)
        terrain = terrain_of(here=deck, there=there(FORMS["level"], 0.0, 4.0))
        way = ride(terrain, CRATE, lambda x, y: 0.0 * x - step, 0.0)
        if step < 1e-3:
            assert way[-1, 0] == pytest.approx(-1.2 + 1.5 * 300 / 240, abs=5e-3)
        else:
            assert way[:, 0].max() + 0.25 < 0.05  # where its front tips over the edge


@pytest.mark.parametrize("low", [0.0, -0.2])
@pytest.mark.parametrize("floor", [a_map, a_mesh, a_deck])
def test_a_wall_on_the_floor_stops_what_comes_to_its_foot(floor: Piece, low: float) -> None:
    wall = TriangleMesh(*mesh_parts.box((0.0, -1.5, low), (1.0, 1.5, 1.0)))
    for body, front in [(BODIES[0], 0.2), (CRATE, 0.25), (BODIES[2], 0.2)]:
        way = ride(terrain_of(floor=floor(FORMS["level"], -4.0, 4.0), wall=wall), body, FORMS["level"], 0.0)
        assert way[:, 0].max() + front == pytest.approx(0.0, abs=1e-3), body
        assert np.abs(way[:, 2] - body[1]).max() < 1e-3


@pytest.mark.parametrize(("here", "there"), [(a_map, a_mesh), (a_mesh, a_deck), (a_deck, a_map)])
def test_a_humanoid_whose_feet_are_on_a_seam_stands_still(here: Piece, there: Piece) -> None:
    """The corners of its feet bear it. If crossings of their edges with the rims were chosen in turn, it would rock."""
    form, model = FORMS["level"], legged.robot("g1")
    terrain = terrain_of(here=here(form, -4.0, 0.0), there=there(form, 0.0, 4.0))
    with world_of(terrain, friction=0.8, sleep=False) as world:
        world.spawn_robot("g1", model.urdf, BodyState((0.0, 0.01, model.height + 3e-3)))
        robot = world.bodies["g1"]
        for name, position in model.stance.items():
            world.client.resetJointState(robot.uid, robot.joints[name], position)
            world.command("g1", name, JointCommand(position=position))
        world.step(720)
        for _ in range(240):
            world.step()
            assert np.linalg.norm(world.state("g1").linear) < 1e-3
