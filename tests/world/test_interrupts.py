"""An interrupt while bodies come and go is what the caller sees, and leaves a world that goes on."""

import sys
from collections.abc import Callable
from types import FrameType

import pytest

from smartmesh_ros import BodyState, Sphere, World
from smartmesh_ros.ground.followers import Belt, Follower, Followers
from smartmesh_ros.ground.shapes import Box
from smartmesh_ros.world.robots.prepared import prepare_robot
from tests import urdfs
from tests.grounds import level

CUBE = urdfs.box((0.2, 0.2, 0.2))
ROBOT = prepare_robot(
    urdfs.robot(
        urdfs.link("base", CUBE, moment=0.1), urdfs.link("arm", CUBE, moment=0.1),
        urdfs.joint("hinge", "fixed", "base", "arm", "", "0.3 0 0"),
    )
)  # fmt: skip
ABOVE = BodyState((0.0, 0.0, 0.3))
OPERATIONS: dict[str, Callable[[World], object]] = {
    "spawn": lambda w: w.spawn("new", Box(0.2, 0.2, 0.2), 1.0, ABOVE),
    "spawn robot": lambda w: w.spawn_robot("new", ROBOT, ABOVE),
    "track": lambda w: w.track("new", 0.1, ABOVE),
    "remove": lambda w: w.remove("box"),
    "remove robot": lambda w: w.remove("robot"),
    "replace": lambda w: w.replace_robot("robot", ROBOT),
    "gone": lambda w: (w.client.removeBody(w.body("robot").uid), w.step()),
}


def interrupted(number: int, operation: Callable[[], object]) -> bool:
    """Interrupt an operation where Python handles signals, at the ``number``-th end of a call into C or begin of one of
    Python. Return False if it ended before."""
    left = number

    def look(frame: FrameType, event: str, called: object) -> None:
        nonlocal left
        left -= event in ("c_return", "call")
        if left == 0:
            raise KeyboardInterrupt

    sys.setprofile(look)
    try:
        operation()
    except KeyboardInterrupt:
        return True
    finally:
        sys.setprofile(None)
    return False


def assert_consistent(world: World) -> None:
    """The world's bodies are those of the ground, which are in PyBullet."""
    for name, body in world.bodies.items():
        links = [f"{name}/{link}" if link else name for link in body.links.values()]
        assert sorted(world.followers[slot].name for slot in world.followers.of(body.uid)) == sorted(links)
        world.state(name)
    uids = {body.uid for body in world.bodies.values()}
    assert {follower.body for follower in world.followers} == uids
    assert len(world.followers) == len(list(world.followers))


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_interrupt_is_not_hidden_and_leaves_a_world_that_goes_on(name: str) -> None:
    """One body at most stays in PyBullet alone, whose number did not come back."""
    number, stays, alone = 0, True, 0
    with World(level()) as world:
        while stays:
            number += 1
            if "box" not in world.bodies:
                world.spawn("box", Sphere(0.1), 1.0, BodyState((1.0, 0.0, 0.1)))
                world.drive_surface("box", "", 0.1)
            if "robot" not in world.bodies:
                world.spawn_robot("robot", ROBOT, BodyState((-1.0, 0.0, 0.1)))
            if "new" in world.bodies:
                world.remove("new")
            stays = interrupted(number, lambda: OPERATIONS[name](world))
            assert_consistent(world)
            world.step()
            assert_consistent(world)
            before, alone = alone, world.client.getNumBodies() - len(world.bodies) - sum(
                follower.solid for follower in world.followers
            )  # fmt: skip
            assert alone - before in (0, 1), number
        for each in list(world.bodies):
            world.remove(each)
        assert not len(world.followers) and world.client.getNumBodies() == alone


def test_a_follower_is_added_and_removed_wholly_or_not_at_all() -> None:
    shape = Sphere(0.1).body_shape
    for number in range(1, 40):
        followers = Followers()
        for body in (1, 1, 2):
            followers.add(Follower(body, len(followers), shape, True))
        followers.remove(0)
        interrupted(number, lambda: followers.add(Follower(2, 5, shape, True, belt=Belt())))  # noqa: B023
        interrupted(number, lambda: followers.remove(1))  # noqa: B023
        slots = [follower.slot for follower in followers]
        assert sorted(followers.of(1) + followers.of(2)) == slots
        assert len(followers) == len(slots)
        assert all(followers[slot].slot == slot for slot in slots)
