"""Robots on ground at constant velocity move as on ground at rest."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, Deck, HeightMap, Terrain
from smartmesh_ros.terrain.grid import FloatArray
from tests.grounds import world_of
from tests.urdfs import joint, link, robot

ROUGH = np.random.default_rng(1).normal(scale=0.03, size=(41, 41))
BEAM = '<box size="0.4 0.3 0.2"/>'
BAR = '<capsule radius="0.1" length="0.3"/>'
ROBOTS = {
    "box": robot(link("box", BEAM)),
    "chain": robot(
        link("first", BEAM), link("second", BAR), link("third"),
        joint("one", "continuous", "first", "second", xyz="0.4 0 0"),
        joint("two", "continuous", "second", "third", xyz="0.4 0 0", axis="0 0 1"),
    ),
}  # fmt: skip


def thrown(urdf: str, drift: FloatArray, across: float) -> FloatArray:
    """Places of the root of a robot that is thrown onto a deck, in the frame of the deck, after each step [m].

    ``across``: friction of the root across its first axis, as a share of that along it."""
    terrain = Terrain()
    terrain.put("deck", Deck(HeightMap(ROUGH, resolution=0.2, origin=(-4.0, -4.0))))
    deck, found = terrain.deck("deck"), []
    with world_of(terrain, restitution=0.3, sleep=False) as world:
        linear = np.array([1.0, 0.5, -2.0]) + drift
        world.spawn_robot("robot", urdf, BodyState((0.2, 0.3, 0.6), linear=tuple(linear), angular=(2.0, 3.0, 1.0)))
        world.client.changeDynamics(world.bodies["robot"].uid, -1, anisotropicFriction=(1.0, across, across))
        for _ in range(180):
            deck.move(drift * world.time, (0.0, 0.0, 0.0, 1.0), time=world.time, velocity=drift, spin=np.zeros(3))
            world.step()
            found.append(world.state("robot").position - drift * world.time)
    return np.array(found)


@pytest.mark.parametrize("across", [1.0, 0.5])
@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_is_thrown_onto_a_deck_at_constant_velocity_as_onto_one_at_rest(name: str, across: float) -> None:
    """Galilei, to rounding, also where edges of a robot touch those of the ground and turn within the step."""
    at_rest, moved = (thrown(ROBOTS[name], np.array(drift), across) for drift in ((0.0, 0.0, 0.0), (1.5, -0.7, 0.4)))
    np.testing.assert_allclose(moved, at_rest, atol=1e-9)
