"""Interface of the physics engines that are compared.

To add an engine, write one file with a subclass of `Engine` and a frozen dataclass of its options, and add a line to
`studies.engines.registry`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.terrain.grid import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class EngineBody:
    """A rigid body of uniform density; ``mass`` [kg]. ``friction``, ``restitution``: of contacts with the ground."""

    shape: Sphere | Box
    mass: float = 1.0
    state: BodyState = field(default_factory=BodyState)
    friction: float = 0.5
    restitution: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """Bodies on a height map.

    ``heights``: (R, C) float64 [m], finite; sample (row r, column c) lies at (c, r) * ``resolution`` [m], and every
    cell is cut along the diagonal from (r, c) to (r + 1, c + 1). ``dt``: duration of a step [s]. ``slide``: velocity of
    the whole map along x and y [m/s]; every `set_ground` places the samples at their current positions.
    """

    heights: FloatArray
    resolution: float
    bodies: Sequence[EngineBody]
    dt: float
    gravity: Vector = (0.0, 0.0, -9.81)
    slide: tuple[float, float] = (0.0, 0.0)

    @property
    def slides(self) -> bool:
        """True if the map moves along x and y."""
        return self.slide != (0.0, 0.0)

    def offset(self, time: float) -> tuple[float, float]:
        """Return the displacement of the map along x and y [m] at ``time`` [s]."""
        return self.slide[0] * time, self.slide[1] * time

    @property
    def size(self) -> tuple[float, float]:
        """Extent of the map along x and y [m]."""
        rows, columns = self.heights.shape
        return (columns - 1) * self.resolution, (rows - 1) * self.resolution


class Contacts(NamedTuple):
    """The contacts of bodies with the ground in a step, as an engine tells them.

    ``bodies`` (C,): their indices. ``points_w`` (C, 3) [m] and ``normals_w`` (C, 3), out of the ground, and ``gaps``
    (C,) [m]: before the step. ``velocities_w`` (C, 3) [m/s]: of what was at the points, after the step.
    ``normal_forces`` (C,) and ``frictions_w`` (C, 3) [N]: on the body in the step; NaN = the engine keeps its friction
    to itself.
    """

    bodies: IntArray
    points_w: FloatArray
    normals_w: FloatArray
    gaps: FloatArray
    velocities_w: FloatArray
    normal_forces: FloatArray
    frictions_w: FloatArray

    @classmethod
    def of(cls, rows: Sequence[Sequence[float]]) -> Contacts:
        """Return contacts from rows of body, point, normal, gap, velocity, normal force and friction."""
        bodies, points, normals, gaps, velocities, forces, frictions = np.split(
            np.array(rows, np.float64).reshape(-1, 15), (1, 4, 7, 8, 11, 12), axis=1
        )
        return cls(bodies[:, 0].astype(np.int64), points, normals, gaps[:, 0], velocities, forces[:, 0], frictions)


class Simulation(ABC):
    """A simulation in one engine. Call `close`, or use it as a context manager."""

    @abstractmethod
    def step(self) -> None:
        """Run one step of the setup's ``dt``."""

    def contacts(self) -> Contacts | None:
        """Return the contacts with the ground in the last step, None if the engine does not tell their forces."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the simulation."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Engine(Simulation):
    """Simulation of bodies on moving ground in one engine.

    The time of `set_ground` is the cost of updating the collider, because no other method does that; `step` runs the
    physics. Only an engine whose colliders follow the bodies also moves its colliders in `step`.
    """

    name: ClassVar[str]

    @abstractmethod
    def __init__(self, setup: Setup, options: Any = None) -> None:
        """Create the simulation; ``options``: the engine's own dataclass, None = defaults."""

    @abstractmethod
    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        """Replace the map by the current heights (R, C) [m]; ``velocities``: vertical (R, C) [m/s], None = unknown."""

    @abstractmethod
    def positions(self) -> FloatArray:
        """Return the centres of the bodies (N, 3) [m]."""

    @abstractmethod
    def orientations(self) -> FloatArray:
        """Return the orientations of the bodies (N, 4) as (x, y, z, w)."""

    @abstractmethod
    def velocities(self) -> FloatArray:
        """Return linear and angular velocities of the bodies in the world frame (N, 6) [m/s, rad/s]."""
