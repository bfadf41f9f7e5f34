"""A ship that moves by closed forms, and worlds with a deck."""

import math
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros import BodyState, Deck, HeightMap, Terrain, World
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import rotation
from tests.grounds import level, world_of

OMEGA = math.tau / 8.0


class Ship(NamedTuple):
    """A ship that surges, heaves, rolls and pitches about a place 2 m above the origin."""

    heave: float = 0.5
    surge: float = 0.3
    tilt: float = math.radians(10.0)
    phase: float = 0.0

    def position(self, time: float) -> FloatArray:
        wave = math.sin(OMEGA * time + self.phase)
        return np.array([self.surge * wave, 0.0, 2.0 + self.heave * wave])

    def orientation(self, time: float) -> FloatArray:
        """Roll, then pitch a quarter of a period later (x, y, z, w)."""
        roll = 0.5 * self.tilt * math.sin(OMEGA * time + self.phase)
        pitch = 0.5 * self.tilt * math.cos(OMEGA * time + self.phase)
        a, b, c, d = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
        return np.array([a * d, b * c, -a * c, b * d])

    def move(self, deck: Deck, time: float) -> None:
        deck.move(self.position(time), self.orientation(time), time=time)

    def to_deck(self, point: Any, time: float) -> FloatArray:
        return np.asarray((np.asarray(point) - self.position(time)) @ rotation(self.orientation(time)))

    def to_world(self, point: FloatArray, time: float) -> FloatArray:
        return np.asarray(rotation(self.orientation(time)) @ point + self.position(time))

    def velocity(self, point: FloatArray, time: float) -> FloatArray:
        """Of a point of the deck's frame, by central differences [m/s]."""
        return np.asarray((self.to_world(point, time + 1e-4) - self.to_world(point, time - 1e-4)) / 2e-4)

    def spin(self, time: float) -> FloatArray:
        """Angular velocity by central differences [rad/s]."""
        after, before = (rotation(self.orientation(time + by)) for by in (1e-4, -1e-4))
        skew = (after - before) / 2e-4 @ rotation(self.orientation(time)).T
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    def state(self, point: FloatArray, time: float) -> BodyState:
        """Of a body that is fixed to a point of the deck."""
        pose = tuple(self.to_world(point, time)), tuple(self.orientation(time))
        return BodyState(*pose, tuple(self.velocity(point, time)), tuple(self.spin(time)))


def a_map() -> HeightMap:
    return level(21, 0.25)


def on_deck(deck: Deck, **physics: Any) -> World:
    """A world of level ground with a deck above it."""
    terrain = Terrain(level(11, 2.0))
    terrain.put("deck", deck)
    return world_of(terrain, **physics)
