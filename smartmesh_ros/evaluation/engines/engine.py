"""What a physics engine must do to be compared.

A further engine is one file: a subclass of `Engine`, a frozen dataclass of its options, and a line in
`studies.engines.registry`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from smartmesh_ros.physics.shapes import Box, Sphere
from smartmesh_ros.physics.state import BodyState, Vector
from smartmesh_ros.terrain.grid import FloatArray


@dataclass(frozen=True, kw_only=True)
class EngineBody:
    """A rigid body of uniform density; ``mass`` [kg]. ``friction`` and ``restitution`` are those of its contacts with
    the ground."""

    shape: Sphere | Box
    mass: float = 1.0
    state: BodyState = field(default_factory=BodyState)
    friction: float = 0.5
    restitution: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """Bodies on a height map.

    ``heights``: (R, C) float64 [m], finite; sample (row r, column c) lies at (c, r) * ``resolution`` [m], and every
    cell is cut along the diagonal from (r, c) to (r + 1, c + 1). ``dt``: length of a step [s]. ``slide``: velocity with
    which the map moves along x and y as one piece [m/s]; its samples lie further on by so much at every `set_ground`.
    """

    heights: FloatArray
    resolution: float
    bodies: Sequence[EngineBody]
    dt: float
    gravity: Vector = (0.0, 0.0, -9.81)
    slide: tuple[float, float] = (0.0, 0.0)

    @property
    def slides(self) -> bool:
        """Whether the map moves along x and y."""
        return self.slide != (0.0, 0.0)

    def offset(self, time: float) -> tuple[float, float]:
        """How far the map has slid by ``time`` [m]."""
        return self.slide[0] * time, self.slide[1] * time

    @property
    def size(self) -> tuple[float, float]:
        """Extent of the map along x and y [m]."""
        rows, columns = self.heights.shape
        return (columns - 1) * self.resolution, (rows - 1) * self.resolution


class Engine(ABC):
    """Bodies on moving ground in one engine. Close it, or use it as a context manager.

    The collider is brought to the ground in `set_ground` and nowhere else, so that timing it times the update; `step`
    is the physics. An engine whose colliders follow the bodies moves them on in `step` too.
    """

    name: ClassVar[str]
    # Whether the engine makes use of the ground's velocity.
    carries_velocity: ClassVar[bool] = False

    @abstractmethod
    def __init__(self, setup: Setup, options: Any = None) -> None:
        """Builds the scene; ``options``: the engine's own dataclass, None = its defaults."""

    @abstractmethod
    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        """Takes the whole map (R, C) [m] as it is now, and how fast it rises, (R, C) [m/s] or None = not known."""

    @abstractmethod
    def step(self) -> None:
        """Runs one step of the setup's ``dt``."""

    @abstractmethod
    def positions(self) -> FloatArray:
        """Centres of the bodies (N, 3) [m]."""

    @abstractmethod
    def orientations(self) -> FloatArray:
        """Orientations of the bodies (N, 4) as (x, y, z, w)."""

    @abstractmethod
    def velocities(self) -> FloatArray:
        """Linear and angular velocities of the bodies in the world's frame (N, 6) [m/s, rad/s]."""

    @abstractmethod
    def close(self) -> None:
        """Ends the scene."""

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
