"""Ground in two pieces, of maps, meshes and decks that are flush, is touched as the same ground in one."""

from functools import cache

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, Sphere, Terrain
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.joints import JointCommand
from tests import legged
from tests.bodies import LYING, UPRIGHT, Turn, about_z
from tests.core import mesh_parts
from tests.ground.pieces import Form, Piece, a_deck, a_map, a_mesh, pieces
from tests.grounds import world_of

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


def ride(terrain: Terrain, body: Body, form: Form = LEVEL, friction: float = 0.0, speed: float = 1.5) -> FloatArray:
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


@cache
def ride_on_one(body: Body, form: Form, *more: float) -> FloatArray:
    """The same on a single map."""
    return ride(pieces(form, a_map), body, form, *more)


def apart(parts: tuple[Piece, Piece], body: Body, form: Form = LEVEL, *more: float) -> FloatArray:
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
            assert apart(parts, body, form, 0.0, speed)[:150].max() < 0.02, (body[0], speed)


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
    model = legged.ROBOTS["g1"]
    with world_of(pieces(LEVEL, *parts), friction=0.8, sleep=False) as world:
        world.spawn_robot("g1", model.urdf, BodyState((0.0, 0.01, model.height + 3e-3)))
        robot = world.bodies["g1"]
        for name, position in model.stance.items():
            world.client.resetJointState(robot.uid, robot.joints[name], position)
            world.command("g1", name, JointCommand(position=position))
        world.step(720)
        for _ in range(240):
            world.step()
            assert np.linalg.norm(world.state("g1").linear) < 1e-3
