"""Inputs of the world while it runs, with the simulated times that the node would assign to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.inputs.conversions import BodyInput
from smartmesh_ros.world.world import World

FloatGrid = NDArray[np.float32]
# Spawns a body; returns False if there is no ground below it yet.
Start = Callable[[World], bool]


@dataclass(frozen=True, kw_only=True)
class Event:
    """An input that arrives at ``arrives`` [s] of simulated time and is valid for its stamp ``at`` [s]. Without a stamp
    (``stamped`` False) it is valid for the time of the step that applies it."""

    arrives: float
    at: float
    stamped: bool = True

    def time(self, now: float) -> float:
        """Return the time [s] for which the event is valid if it is applied at ``now`` [s]."""
        return self.at if self.stamped else now


@dataclass(frozen=True, kw_only=True, eq=False)
class MapCame(Event):
    """A whole map of a tile; ``raster`` None = the tile is removed. ``delay`` [s]: see `HeightMap.delay`."""

    tile: str
    raster: Raster | None
    velocities: FloatGrid | None = None
    delay: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class RegionCame(Event):
    """New heights [m] of a rectangle of a tile. ``delay`` [s]: see `HeightMap.delay`."""

    tile: str
    row: int
    column: int
    heights: FloatGrid
    velocities: FloatGrid | None = None
    delay: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BodiesCame(Event):
    """Dictated poses in the terrain's frame; ``gone``: bodies that are no longer in the message."""

    bodies: tuple[BodyInput, ...]
    gone: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class JointsCame(Event):
    """A command to robots' joints, as a sensor_msgs/JointState."""

    message: Any
