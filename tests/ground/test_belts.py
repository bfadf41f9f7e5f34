"""Belts and turntables take along what stands on them, whatever their speed."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, GridGeometry, HeightMap, PhysicsConfig, World, WorldConfig

SAMPLES = 41
Place = tuple[float, float, float]  # x, y [m] and yaw [rad]


@dataclass(frozen=True)
class Belt:
    """A level map that is elsewhere at each time: ``place`` of its middle. ``maps``, ``rate`` [Hz]: of maps and of the
    physics. ``noise`` [cells]: how far each map lies beside its place, at most."""

    place: Callable[[float], Place]
    resolution: float = 0.1
    maps: int = 60
    rate: int = 240
    noise: float = 0.0

    def geometry(self, time: float) -> GridGeometry:
        x, y, yaw = self.place(time)
        half = 0.5 * (SAMPLES - 1) * self.resolution
        cos, sin = math.cos(yaw), math.sin(yaw)
        aside = self.noise * self.resolution * np.random.default_rng(round(1e3 * time)).uniform(-1.0, 1.0, 2)
        origin = (x - half * cos + half * sin + aside[0], y - half * sin - half * cos + aside[1], 0.0)
        return GridGeometry(rows=SAMPLES, columns=SAMPLES, resolution=self.resolution, origin=origin, yaw=yaw)


class Ride(NamedTuple):
    """What a body did on a belt: its states and the times (n,) of these [s]."""

    times: np.ndarray
    states: list[BodyState]

    def at(self, time: float) -> BodyState:
        return self.states[int(np.abs(self.times - time).argmin())]


def ride(
    belt: Belt,
    duration: float,
    start: tuple[float, float] = (0.013, 0.017),
    speed: float = 0.0,
) -> Ride:
    """A box that stands on the belt from time zero on, at a ``speed`` along x [m/s]."""
    config = WorldConfig(physics=PhysicsConfig(rate=float(belt.rate)))
    heights = np.zeros((SAMPLES, SAMPLES), np.float32)
    with World(HeightMap(heights, geometry=belt.geometry(0.0)), config) as world:
        world.spawn("box", Box(0.3, 0.3, 0.2), 1.0, BodyState((*start, 0.1), linear=(speed, 0.0, 0.0)))
        times, states = [0.0], [world.state("box")]
        for step in range(round(duration * belt.rate)):
            if step and step % (belt.rate // belt.maps) == 0:
                world.terrain.put("", HeightMap(heights, geometry=belt.geometry(world.time), time=world.time))
            world.step()
            times.append(world.time)
            states.append(world.state("box"))
    return Ride(np.array(times), states)


def steady(x: float, y: float = 0.0) -> Callable[[float], Place]:
    """The place of a belt of such a velocity [m/s]."""
    return lambda time: (x * time, y * time, 0.0)


@pytest.mark.parametrize(
    "belt",
    [
        Belt(steady(1.0), resolution=0.5, maps=240),
        Belt(steady(0.05)),
        Belt(steady(0.05), maps=20),
        Belt(steady(0.02), maps=240),
        Belt(steady(0.004), maps=60),
        Belt(steady(1.0), maps=20),
        Belt(steady(0.5), resolution=0.5, maps=20),
    ],
    ids=["1 m/s, coarse, 240 Hz", "0.05", "0.05, 20 Hz", "0.02, 240 Hz", "0.004", "1 m/s, 20 Hz", "coarse, 20 Hz"],
)
def test_a_belt_of_any_speed_takes_a_box_along(belt: Belt) -> None:
    """Also where the map's origin moves by less than a hundredth of a cell from map to map."""
    gone = ride(belt, 4.0).at(4.0).position[0] - 0.013
    assert 0.7 <= gone / belt.place(4.0)[0] <= 1.1


def test_a_belt_that_ramps_stops_and_comes_back_has_the_box_on_it() -> None:
    """To 0.3 m/s in 2 s and on for 1 s, at rest for 1 s, and back at 0.3 m/s."""

    def place(time: float) -> tuple[float, float, float]:
        out = 0.075 * min(time, 2.0) ** 2 + 0.3 * min(max(time - 2.0, 0.0), 1.0)
        return out - 0.3 * max(time - 4.0, 0.0), 0.0, 0.0

    gone = ride(Belt(place), 5.0)
    assert gone.at(1.0).linear[0] == pytest.approx(0.15, abs=0.02)
    assert gone.at(2.9).linear[0] == pytest.approx(0.3, abs=0.02)
    assert gone.at(2.9).position[0] - 0.013 == pytest.approx(place(2.9)[0], abs=0.03)
    assert abs(gone.at(3.3).linear[0]) < 1e-3
    assert gone.at(3.3).position[0] == pytest.approx(gone.at(4.0).position[0], abs=1e-3)
    assert gone.at(4.9).linear[0] == pytest.approx(-0.3, abs=0.02)
    assert gone.at(5.0).position[0] - 0.013 == pytest.approx(place(5.0)[0], abs=0.05)


def test_a_belt_whose_maps_take_the_place_of_heights_where_it_stops_has_stopped() -> None:
    """`replace` says that the map is where it was."""
    belt, heights = Belt(steady(0.3)), np.zeros((41, 41))
    terrain = World(HeightMap(heights, geometry=belt.geometry(0.0)))
    with terrain as world:
        for step in range(1, 13):
            world.terrain.put("", HeightMap(heights, geometry=belt.geometry(step / 60), time=step / 60))
        heightmap = world.terrain.tiles[""]
        assert heightmap.track.motion[:2] == pytest.approx((0.3, 0.0))
        heightmap.replace(heights, time=13 / 60)
        assert heightmap.track.motion[:2] == (0.0, 0.0)
        assert heightmap.placed_at(14 / 60).origin[0] == heightmap.geometry.origin[0]


def test_a_belt_that_passes_whole_cells_a_map_goes_on() -> None:
    """From 4 to 8 m/s in 2 s: at 6 m/s its maps come a cell further on each time."""
    belt = Belt(lambda time: (4.0 * time + time * time, 0.0, 0.0))
    found = ride(belt, 1.2, start=(0.5, 0.0), speed=4.0)
    for time in (0.8, 0.9, 1.0, 1.1, 1.2):
        assert found.at(time).linear[0] == pytest.approx(4.0 + 2.0 * time, abs=0.1)


TRAVELS = Belt(lambda time: (0.1 * round(60.0 * time), 0.1 * round(30.0 * time), 0.0), maps=20, noise=0.004)


@pytest.mark.parametrize(("belt", "duration"), [(TRAVELS, 0.25), (Belt(steady(0.0), noise=0.004), 2.0)])
def test_a_map_that_travels_with_a_robot_or_is_never_quite_in_its_place_takes_nothing_along(
    belt: Belt, duration: float
) -> None:
    """By a cell with each map, and beside that by as little as rounding makes."""
    x, y, _ = ride(belt, duration).at(duration).position
    assert (x, y) == pytest.approx((0.013, 0.017), abs=1e-4)


def heading(orientation: tuple[float, float, float, float]) -> float:
    return 2.0 * math.atan2(orientation[2], orientation[3])


@pytest.mark.parametrize("maps", [60, 20])
def test_a_turntable_takes_a_box_round(maps: int) -> None:
    """0.5 rad/s for 4 s, a box 1 m from its middle."""
    found = ride(Belt(lambda time: (0.0, 0.0, 0.5 * time), maps=maps), 4.0, start=(1.0, 0.0)).at(4.0)
    x, y, z = found.position
    assert math.atan2(y, x) == pytest.approx(2.0, abs=0.06)
    assert math.hypot(x, y) == pytest.approx(1.0, abs=0.03)
    assert heading(found.orientation) == pytest.approx(2.0, abs=0.06)
    assert z == pytest.approx(0.1, abs=1e-3)
    assert found.linear[:2] == pytest.approx((-0.5 * y, 0.5 * x), abs=0.02)


def test_a_platform_that_drives_a_curve_has_its_box_on_it() -> None:
    """It turns and goes, about a middle 2 m beside it."""

    def place(time: float) -> tuple[float, float, float]:
        return 2.0 * math.sin(0.4 * time), 2.0 - 2.0 * math.cos(0.4 * time), 0.4 * time

    found = ride(Belt(place), 3.0, start=(0.5, 0.0)).at(3.0)
    x, y, yaw = place(3.0)
    there = (x + 0.5 * math.cos(yaw), y + 0.5 * math.sin(yaw))
    assert found.position[:2] == pytest.approx(there, abs=0.1)
    assert heading(found.orientation) == pytest.approx(yaw, abs=0.05)
