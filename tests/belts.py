"""Ground that moves as one piece, as maps tell it: belts and turntables, and bodies that ride on them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smartmesh_ros import BodyState, Box, HeightMap, PatchConfig, PhysicsConfig, World, WorldConfig
from smartmesh_ros.patches.config import PatchKind
from smartmesh_ros.terrain.grid import GridGeometry

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
    kind: PatchKind = "auto",
    speed: float = 0.0,
) -> Ride:
    """A box that stands on the belt from time zero on, at a ``speed`` along x [m/s]."""
    config = WorldConfig(physics=PhysicsConfig(rate=float(belt.rate)), patch=PatchConfig(kind=kind))
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
