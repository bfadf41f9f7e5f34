"""Belts and turntables take along what stands on them: maps that are elsewhere at each time."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, GridGeometry, HeightMap, Terrain, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import about_z, rotation
from tests.core import mesh_parts
from tests.grounds import add
from tests.urdfs import link, robot

SAMPLES, CELL = 41, 0.1
FLAT = np.zeros((SAMPLES, SAMPLES), np.float32)
Place = Callable[[float], tuple[float, float, float]]  # x, y [m] and yaw [rad] of a belt's middle at a time


def belt(place: Place, time: float) -> HeightMap:
    """A level map that is somewhere else at each time."""
    x, y, yaw = place(time)
    half, cos, sin = 0.5 * (SAMPLES - 1) * CELL, math.cos(yaw), math.sin(yaw)
    origin = (x - half * cos + half * sin, y - half * sin - half * cos, 0.0)
    geometry = GridGeometry(rows=SAMPLES, columns=SAMPLES, resolution=CELL, origin=origin, yaw=yaw)
    return HeightMap(FLAT, geometry=geometry, time=time)


BOX = Box(0.3, 0.3, 0.2)
ROBOT = robot(link("box", '<box size="0.3 0.3 0.2"/>'))


def ride(
    place: Place, duration: float, start: tuple[float, float], maps: int = 60, speed: float = 0.0,
    body: Shape | str = BOX, share: float = 0.2,
) -> Callable[[float], BodyState]:  # fmt: skip
    """The state, at a time, of a box or robot that stands on a belt from time zero on, at a ``speed`` along x [m/s];
    ``maps`` come a second. ``share``: PyBullet's `frictionERP`."""
    with World(belt(place, 0.0)) as world:
        add(world, "box", body, BodyState((*start, 0.1), linear=(speed, 0.0, 0.0)))
        world.client.setPhysicsEngineParameter(frictionERP=share)
        states = [world.state("box")]
        for step in range(round(duration / world.dt)):
            if step and step % (240 // maps) == 0:
                world.terrain.put("", belt(place, world.time))
            world.step()
            states.append(world.state("box"))
    return lambda time: states[round(240.0 * time)]


def test_a_belt_that_passes_whole_cells_a_map_goes_on() -> None:
    """From 4 to 8 m/s in 2 s: at 6 m/s its maps come a cell further on each time."""
    found = ride(lambda time: (4.0 * time + time * time, 0.0, 0.0), 1.2, (0.5, 0.0), speed=4.0)
    for time in (0.8, 0.9, 1.0, 1.1, 1.2):
        assert found(time).linear[0] == pytest.approx(4.0 + 2.0 * time, abs=0.1)


@pytest.mark.parametrize(
    ("body", "start", "maps", "share", "error"),
    [*((BOX, (1.0, 0.0), maps, 0.2, 2e-5) for maps in (20, 60, 240)), (ROBOT, (0.513, 0.028), 60, 0.0, 2e-3)],
)
def test_what_was_taken_along_by_a_map_that_turns_does_not_creep(
    body: Shape | str, start: tuple[float, float], maps: int, share: float, error: float
) -> None:
    """In the two seconds after the first one. Friction of a robot aims at the proxy's velocity if PyBullet's
    `frictionERP` is zero, which is that of the ground there and not of the samples around."""
    found = ride(lambda time: (0.0, 0.0, time), 3.0, start, maps, body=body, share=share)
    begin, end = (rotation(about_z(time)).T @ found(time).position for time in (1.0, 3.0))
    assert end == pytest.approx(begin, abs=error)
    assert found(3.0).angular == pytest.approx((0.0, 0.0, 1.0), abs=1e-3)


SPEED = 0.8  # [m/s], [rad/s]
# Intervals between what is told of the ground, again and again [s].
INTERVALS = {
    "by turns": (0.0045, 0.0288),
    "twice, a millisecond apart": (0.001, 0.0157),
    "one in five is lost": (1 / 60, 1 / 60, 1 / 60, 1 / 60, 2 / 60),
}


def slide(time: float) -> tuple[float, float, float]:
    return SPEED * time, 0.0, 0.0


def turn(time: float) -> tuple[float, float, float]:
    return 0.0, 0.0, SPEED * time


@pytest.mark.parametrize("intervals", INTERVALS.values(), ids=INTERVALS)
@pytest.mark.parametrize("place", [slide, turn])
@pytest.mark.parametrize("kind", ["map", "deck", "mesh"])
def test_ground_that_moves_evenly_takes_a_box_along_whenever_it_is_told(
    place: Place, kind: str, intervals: tuple[float, ...]
) -> None:
    terrain, (vertices, triangles) = Terrain(), mesh_parts.sheet(4.0, 40)
    if kind == "deck":
        terrain.put("deck", Deck(belt(slide, 0.0), thickness=1.0))
    mesh = TriangleMesh(vertices, triangles)
    if kind == "mesh":
        terrain.put("", mesh)

    def at(time: float) -> np.ndarray:
        """Where the box should be."""
        x, y, yaw = place(time)
        return np.asarray(rotation(about_z(yaw)) @ (0.5, 0.0, 0.1) + (x, y, 0.0))

    times = itertools.accumulate(itertools.cycle(intervals), initial=0.0)
    told = next(times)
    with World(terrain) as world:
        for step in range(360):
            while told <= world.time:
                x, y, yaw = place(told)
                if kind == "deck":
                    terrain.deck("deck").move((x, y, 0.0), about_z(yaw), time=told)
                elif kind == "mesh":
                    mesh.move(vertices @ rotation(about_z(yaw)).T + (x, y, 0.0), time=told)
                else:
                    terrain.put("", belt(place, told))
                told = next(times)
            if step == 120:
                linear = (at(world.time + 1e-4) - at(world.time - 1e-4)) / 2e-4
                spin = (0.0, 0.0, SPEED if place is turn else 0.0)
                state = BodyState(tuple(at(world.time)), about_z(place(world.time)[2]), tuple(linear), spin)
                world.spawn("box", BOX, 1.0, state)
            world.step()
        assert world.state("box").position == pytest.approx(at(world.time), abs=5e-4)
