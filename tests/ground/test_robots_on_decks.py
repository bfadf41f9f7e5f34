"""Bodies and robots on decks at constant velocity move as on ground at rest, and rest on decks that turn."""

import math
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, Material, Sphere, Terrain
from smartmesh_ros.ground.shapes import Cylinder, Shape
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import about_z, rotation
from tests.grounds import add, level, world_of
from tests.urdfs import joint, link, robot

Surface = dict[str, Any]

DRIFT = np.array([20.0, -5.0, 0.4])  # of the deck [m/s]
ROUGH = np.random.default_rng(1).normal(scale=0.03, size=(41, 41))
ALONG = np.linspace(-6.0, 6.0, 41)
BEAM = '<box size="0.4 0.3 0.2"/>'
BAR = '<capsule radius="0.1" length="0.3"/>'
# Links of robots turn within the step, also where their edges touch those of the ground.
ROOT = robot(link("box", BEAM))
CHAIN = robot(
    link("first", BEAM), link("second", BAR), link("third"),
    joint("one", "continuous", "first", "second", xyz="0.4 0 0"),
    joint("two", "continuous", "second", "third", xyz="0.4 0 0", axis="0 0 1"),
)  # fmt: skip
BOX, BALL, CAN = Box(0.5, 0.4, 0.3), Sphere(0.2), Cylinder(radius=0.2, height=0.3)
# What PyBullet is told of a body.
PLAIN: Surface = {}
SKATES: Surface = {"anisotropicFriction": (1.0, 0.5, 0.5)}
SOFT: Surface = {"contactStiffness": 3000.0, "contactDamping": 50.0}
RESISTS: Surface = {"rollingFriction": 0.02, "spinningFriction": 0.05}
YIELDING = Material(stiffness=2e5, damping=1e4)


def thrown(
    body: Shape | str,
    drift: FloatArray,
    waves: float,
    surface: Surface,
    yaw: float,
    height: float = 0.6,
    material: Material | None = None,
) -> FloatArray:
    """Places of a body, or of the root of a robot, that is thrown onto a deck, in the deck's frame after each step [m].

    ``drift`` [m/s]: of the deck, zero = the ground is no deck. ``waves`` [m]: amplitude of waves on the ground.
    ``surface``: of the body. ``yaw`` [rad]: of the deck. ``height`` [m]: of the body at the start. ``material``: of the
    ground."""
    tile, terrain, found, turn = level(41, 0.2, material=material), Terrain(), [], rotation(about_z(yaw))
    terrain.put("deck", Deck(tile) if drift.any() else tile)
    linear, spin = turn @ [1.0, 0.5, -2.0] + drift, turn @ [2.0, 3.0, 1.0]
    with world_of(terrain, restitution=0.3, sleep=False) as world:
        state = BodyState(tuple(turn @ [0.2, 0.34, height]), about_z(yaw), tuple(linear), tuple(spin))
        add(world, "body", body, state)
        world.client.changeDynamics(world.bodies["body"].uid, -1, **surface)
        for step in range(180):
            time = world.time
            if step % 4 == 0:
                tile.replace(ROUGH + waves * np.sin(ALONG + 3.0 * time), time=time)
            for deck in terrain.decks.values():
                deck.move(drift * time, about_z(yaw), time=time, velocity=drift, spin=np.zeros(3))
            world.step()
            found.append(turn.T @ (world.state("body").position - drift * world.time))
    return np.array(found)


@pytest.mark.parametrize(
    ("body", "waves", "surface", "yaw", "error"),
    [
        *((body, 0.0, PLAIN, 0.0, 1e-9) for body in (BOX, BALL, ROOT, CHAIN)),
        *((body, 0.0, SKATES, 0.0, 1e-9) for body in (BOX, ROOT, CHAIN)),
        (BOX, 0.0, SOFT, 0.0, 1e-9), (CAN, 0.1, PLAIN, 0.0, 1e-8),
        (BOX, 0.1, PLAIN, 0.6, 1e-9), (BALL, 0.1, PLAIN, 0.6, 1e-9),
    ],
)  # fmt: skip
def test_physics_on_a_deck_at_constant_velocity_is_that_on_ground_at_rest(
    body: Shape | str, waves: float, surface: Surface, yaw: float, error: float
) -> None:
    """Galilei, to rounding."""
    at_rest, moved = thrown(body, np.zeros(3), waves, surface, 0.0), thrown(body, DRIFT, waves, surface, yaw)
    np.testing.assert_allclose(moved, at_rest, rtol=0.0, atol=error)


@pytest.mark.parametrize(("body", "error"), [(BOX, 1e-9), (BALL, 1e-9), (CAN, 1e-7)])
def test_rolling_resistance_on_waves_of_a_deck_is_that_on_waves_at_rest(body: Shape, error: float) -> None:
    tough = Material(rolling=0.1)
    at_rest, moved = (
        thrown(body, drift, 0.1, PLAIN, yaw, material=tough) for drift, yaw in ((np.zeros(3), 0.0), (DRIFT, 0.6))
    )
    np.testing.assert_allclose(moved, at_rest, rtol=0.0, atol=error)


@pytest.mark.parametrize("height", [0.02, -0.1])
@pytest.mark.parametrize("body", [BOX, ROOT])
def test_what_begins_in_a_deck_comes_out_as_out_of_ground_at_rest(body: Shape | str, height: float) -> None:
    """The solver pushes it out if its middle is above the ground; else it is put onto it, at most at 5 m/s along it."""
    at_rest, moved = (thrown(body, drift, 0.0, PLAIN, 0.0, height) for drift in (np.zeros(3), DRIFT))
    np.testing.assert_allclose(moved, at_rest, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("surface", "material", "share", "error"),
    [
        (PLAIN, Material(), 0.2, 2e-5), (PLAIN, Material(), 0.0, 1e-3), (PLAIN, Material(rolling=0.1), 0.2, 2e-5),
        (RESISTS, Material(), 0.2, 1e-3), (PLAIN, YIELDING, 0.2, 1e-3),
    ],
)  # fmt: skip
@pytest.mark.parametrize(("body", "height"), [(BOX, 0.15), (CAN, 0.15), (ROOT, 0.1)])
@pytest.mark.parametrize("rate", [60.0, 240.0])
def test_what_rests_on_a_deck_that_turns_stays_there(
    rate: float, body: Shape | str, height: float, surface: Surface, material: Material, share: float, error: float
) -> None:
    """To 20 um, a metre off the axis, for half a turn; Bullet's own friction against rolling moves it by half a
    millimetre, and ground that gives lies as much lower. ``share``: PyBullet's `frictionERP`."""
    terrain, spin = Terrain(), np.array([0.0, 0.0, 1.0])
    deck = Deck(level(41, 0.2, material=material))
    terrain.put("deck", deck)
    with world_of(terrain, rate=rate, friction=0.8, sleep=False) as world:
        add(world, "body", body, BodyState((1.0, 0.0, height), linear=(0.0, 1.0, 0.0), angular=tuple(spin)))
        world.client.changeDynamics(world.bodies["body"].uid, -1, **surface)
        world.client.setPhysicsEngineParameter(frictionERP=share)
        while world.time < math.pi:
            deck.move(np.zeros(3), about_z(world.time), time=world.time, velocity=np.zeros(3), spin=spin)
            world.step()
        found, turn = world.state("body"), rotation(about_z(world.time))
    np.testing.assert_allclose(turn.T @ found.position, (1.0, 0.0, height), rtol=0.0, atol=error)
    np.testing.assert_allclose(found.angular, spin, rtol=0.0, atol=1e-4)
