"""Bodies that fall off the ground are told of once, with the place, and removed far below it."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, HeightMap, Sphere, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.settings import FallConfig
from tests.grounds import add, level, said_by, shaped
from tests.urdfs import ROVER

SIDE = 2.0  # half the side of the ground [m]


def holed() -> HeightMap:
    return shaped(lambda x, y: np.where((np.abs(y) < 4.05) & (np.abs(x - 1.0) < 3.05), np.nan, 0.0), 121)


def mesh() -> TriangleMesh:
    corners = [(x, y, 0.0) for x in (-SIDE, SIDE) for y in (-SIDE, SIDE)]
    return TriangleMesh(corners, [[0, 2, 3], [0, 3, 1]])


@pytest.mark.parametrize(("ground", "start", "edge"), [(level, 1.5, SIDE), (mesh, 1.5, SIDE), (holed, -2.5, -2.0)])
@pytest.mark.parametrize("what", [Sphere(0.2), Box(0.3, 0.3, 0.3), ROVER], ids=["ball", "box", "robot"])
def test_a_body_that_leaves_the_ground_is_told_of_once_and_removed_below(
    ground: Callable[[], HeightMap | TriangleMesh], start: float, edge: float, what: Shape | str
) -> None:
    speed = 3.0
    with World(ground(), WorldConfig(falls=FallConfig(depth=10.0))) as world:
        lines = said_by(world)
        state = BodyState((start, 0.0, 0.3), linear=(speed, 0.0, 0.0))
        add(world, "it", what, state, on_ground=True)
        world.spawn("other", Sphere(0.2), 1.0, BodyState((-1.7, -1.7 if ground is not holed else 4.5, 0.2)))
        lines.clear()
        while not world.falls.falling and world.time < 3.0:
            world.step()
        assert world.falls.falling.keys() == {"it"}
        x, _, z = world.falls.falling["it"]
        assert x == pytest.approx(edge, abs=0.1 + world.config.falls.period * speed), "where it left the ground"
        assert z == 0.0
        assert len(lines) == 1 and "'it' at (" in lines[0] and "falls: there is no ground there" in lines[0]
        begun, below = world.time, -world.state("it").position[2]
        while not world.lost and world.time < begun + 3.0:
            deepest = -world.state("it").position[2]
            world.step()
        assert world.bodies.keys() == {"other"} and len(lines) == 1 and not world.falls.falling
        assert "was 10 m below the ground at (" in world.lost["it"]
        assert below < 2.0
        assert 10.0 - 0.7 <= deepest <= 10.0 + (world.config.falls.period + 0.05) * math.sqrt(2 * 9.81 * 11.0)


def test_bodies_that_have_ground_again_or_never_lost_it_are_not_told_of() -> None:
    """Over holes that are smaller than they, on hills, thrown from a ramp, and over a hole that is filled in time."""
    ground = level(81)
    heights = 0.3 * np.sin(0.3 * np.tile(np.arange(81.0), (81, 1)))
    heights[::9, ::7] = np.nan
    ground.replace(heights, time=0.0)
    with World(ground, WorldConfig(falls=FallConfig(depth=1.0))) as world:
        lines = said_by(world)
        for k in range(12):
            state = BodyState((0.5 * k - 3.0, 0.3 * k - 2.0, 1.0), linear=(1.0, 0.5, 0.0), angular=(0.0, 0.0, 1.0))
            world.spawn(f"box_{k}", Box(0.4, 0.4, 0.2), 1.0, state)
        world.step(480)
        assert lines == [] and len(world.bodies) == 12
        filled = np.where(np.isnan(heights), 0.0, heights)
        filled[:, 20:60] = np.nan
        ground.replace(filled, time=world.time)
        while not world.falls.falling and world.time < 5.0:
            world.step()
        assert len(lines) == 1
        ground.replace(np.full((81, 81), -0.8), time=world.time)
        world.step(240)
        assert not world.falls.falling and len(world.bodies) == 12 and not world.lost


def test_a_body_beside_the_ground_counts_from_where_it_started() -> None:
    with World(level(), WorldConfig(falls=FallConfig(depth=5.0))) as world:
        lines = said_by(world)
        world.spawn("it", Sphere(0.2), 1.0, BodyState((50.0, 0.0, 30.0)))
        world.step(240)
        assert len(lines) == 1 and world.state("it").position[2] == pytest.approx(30.0 - 0.5 * 9.81, abs=0.1)
        world.step(60)
        assert not world.bodies and "ground at (50.00, 0.00, " in world.lost["it"]


def test_without_any_ground_nothing_is_lost() -> None:
    """A body that was spawned before the first map is put onto it when it comes."""
    with World(None, WorldConfig(falls=FallConfig(depth=1.0))) as world:
        world.spawn("it", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 1.0)))
        world.step(240)
        world.terrain.put("", level(time=world.time))
        world.step(120)
        assert world.state("it").position[2] == pytest.approx(0.2, abs=5e-3)
