"""Bodies and robots on decks at constant velocity move as on ground at rest, and rest on decks that turn."""

import math
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, Material, Sphere
from smartmesh_ros.ground.shapes import Cylinder, Shape
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import about_z, rotation
from tests.grounds import add, level, terrain_of, world_of
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
YIELDING, TOUGH = Material(stiffness=2e5, damping=1e4), Material(rolling=0.1)


def thrown(body: Shape | str, drift: FloatArray, yaw: float, given: dict[str, Any]) -> FloatArray:
    """Places of a body, or of the root of a robot, that is thrown onto a deck, in the deck's frame after each step [m].

    ``drift`` [m/s] and ``yaw`` [rad]: of the deck, no drift = the ground is no deck. ``given``: amplitude of ``waves``
    on the ground [m], its ``material``, the ``surface`` of the body, and its ``height`` at the start [m]."""
    waves, height = given.get("waves", 0.0), given.get("height", 0.6)
    tile, found = level(41, 0.2, material=given.get("material")), []
    terrain = terrain_of(deck=Deck(tile) if drift.any() else tile)
    turn = rotation(about_z(yaw))
    linear, spin = turn @ [1.0, 0.5, -2.0] + drift, turn @ [2.0, 3.0, 1.0]
    with world_of(terrain, restitution=0.3, sleep=False) as world:
        state = BodyState(tuple(turn @ [0.2, 0.34, height]), about_z(yaw), tuple(linear), tuple(spin))
        add(world, "body", body, state)
        world.client.changeDynamics(world.bodies["body"].uid, -1, **given.get("surface", PLAIN))
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
    ("body", "yaw", "given", "error"),
    [
        *((body, 0.0, {}, 1e-9) for body in (BOX, BALL, ROOT, CHAIN)),
        *((body, 0.0, {"surface": SKATES}, 1e-9) for body in (BOX, ROOT, CHAIN)),
        (BOX, 0.0, {"surface": SOFT}, 1e-9), (CAN, 0.0, {"waves": 0.1}, 1e-8),
        *((body, 0.6, {"waves": 0.1}, 1e-9) for body in (BOX, BALL)),
        *((body, 0.6, {"waves": 0.1, "material": TOUGH}, 1e-9) for body in (BOX, BALL)),
        (CAN, 0.6, {"waves": 0.1, "material": TOUGH}, 1e-7),
        # The solver pushes out what begins in the ground if its middle is above it; else it is put onto it.
        *((body, 0.0, {"height": height}, 1e-6) for body in (BOX, ROOT) for height in (0.02, -0.1)),
    ],
)  # fmt: skip
def test_physics_on_a_deck_at_constant_velocity_is_that_on_ground_at_rest(
    body: Shape | str, yaw: float, given: dict[str, Any], error: float
) -> None:
    """Galilei, to rounding."""
    at_rest, moved = thrown(body, np.zeros(3), 0.0, given), thrown(body, DRIFT, yaw, given)
    np.testing.assert_allclose(moved, at_rest, rtol=0.0, atol=error)


@pytest.mark.parametrize(
    ("surface", "material", "share", "error"),
    [
        (PLAIN, Material(), 0.2, 2e-5), (PLAIN, Material(), 0.0, 1e-3), (PLAIN, TOUGH, 0.2, 2e-5),
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
    spin, deck = np.array([0.0, 0.0, 1.0]), Deck(level(41, 0.2, material=material))
    with world_of(terrain_of(deck=deck), rate=rate, friction=0.8, sleep=False) as world:
        add(world, "body", body, BodyState((1.0, 0.0, height), linear=(0.0, 1.0, 0.0), angular=tuple(spin)))
        world.client.changeDynamics(world.bodies["body"].uid, -1, **surface)
        world.client.setPhysicsEngineParameter(frictionERP=share)
        while world.time < math.pi:
            deck.move(np.zeros(3), about_z(world.time), time=world.time, velocity=np.zeros(3), spin=spin)
            world.step()
        found, turn = world.state("body"), rotation(about_z(world.time))
    np.testing.assert_allclose(turn.T @ found.position, (1.0, 0.0, height), rtol=0.0, atol=error)
    np.testing.assert_allclose(found.angular, spin, rtol=0.0, atol=1e-4)
