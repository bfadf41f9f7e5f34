"""A body that somebody removes from PyBullet is no body of the world any more, which says so and goes on."""

import copy
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Carrier, Deck, InputError, JointCommand, Sphere, World
from smartmesh_ros.ground.shapes import Box
from smartmesh_ros.world.states import SimulatedStates
from tests import urdfs
from tests.grounds import level, terrain_of

DOWN = (0.0, 0.0, -1.0)
KINDS: dict[str, Callable[[World], object]] = {
    "box": lambda w: w.spawn("it", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 0.0, 0.1))),
    "robot": lambda w: w.spawn_robot("it", urdfs.ROVER, BodyState((0.0, 0.0, 0.5))),
    "tracked": lambda w: w.track("it", 0.2, BodyState((0.0, 0.0, 0.3))),
}


def steps(world: World) -> None:
    world.step(3)


def rays(world: World) -> None:
    assert world.cast_rays([[0.0, 0.0, 5.0]], [DOWN], 10.0).names[1:] == ("other",)


def copies(world: World) -> None:
    with copy.deepcopy(world) as other:
        assert other.bodies.keys() == {"other"}


def new_episode(world: World) -> None:
    world.reset(1)
    world.reset_bodies()


def another(world: World) -> None:
    """PyBullet gives the number of the removed body to the next one."""
    world.spawn("new", Sphere(0.1), 1.0, BodyState((1.5, 1.5, 0.1)))
    world.remove("new")


def same_name(world: World) -> None:
    world.spawn("it", Sphere(0.1), 1.0, BodyState((1.5, 1.5, 0.1)))
    assert world.state("it").position == (1.5, 1.5, 0.1)
    world.remove("it")


LOOKS: dict[str, Callable[[World], object]] = {
    "step": steps, "update": lambda w: w.update(), "list": lambda w: w.bodies, "snapshot": lambda w: w.snapshot(),
    "save": lambda w: w.save(), "rays": rays, "copy": copies, "reset": new_episode, "another": another,
    "same name": same_name, "states": lambda w: SimulatedStates(w).read(), "wake": lambda w: w.wake(),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("look", LOOKS)
def test_a_body_that_was_removed_through_pybullet_is_lost(kind: str, look: str) -> None:
    """It carried a deck, and its joints were driven."""
    with World(terrain_of(ground=level(), deck=Deck(level(5), position=(0.0, 0.0, 2.0)))) as world:
        KINDS[kind](world)
        world.carry("deck", Carrier("it"))
        if kind == "robot":
            for joint in world.body("it").joints:
                world.command("it", joint, JointCommand(effort=0.1))
        world.spawn("other", Sphere(0.1), 1.0, BodyState((1.0, 0.0, 0.1)))
        world.step()
        world.client.removeBody(world.body("it").uid)
        LOOKS[look](world)
        assert world.bodies.keys() == {"other"}
        assert world.lost == {"it": "was removed through PyBullet"}
        assert world.client.getNumBodies() == 2, "the other body, and its piece of ground"
        for call in (world.state, world.remove):
            with pytest.raises(InputError, match="no body 'it'; known: 'other'"):
                call("it")
        world.step(120)
        np.testing.assert_allclose(world.state("other").position, (1.0, 0.0, 0.1), atol=1e-3)
