"""Interface of the physics engines that are compared, and the engines by name.

To add an engine, write one file with a subclass of `Engine`, whose options are keywords of its constructor, and add a
line to `ENGINES`. An engine whose package is not installed is left out, with a reason.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple, Self

import numpy as np

from smartmesh_ros import BodyState, Box, InputError, Sphere
from smartmesh_ros.ground.state import Vector
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
class GroundSetup:
    """A height map.

    ``heights``: (R, C) [m], finite; sample (row r, column c) lies at ``origin`` + (c, r) * ``resolution`` [m], and each
    cell is cut along the diagonal from (r, c) to (r + 1, c + 1). ``dt``: duration of a step [s]. ``slide``: velocity of
    the whole map along x and y [m/s]; every `set_ground` places the samples at their current positions. ``plane``: the
    ground is the engine's own plane z = 0, and no map.
    """

    heights: Any
    resolution: float
    dt: float
    origin: tuple[float, float] = (0.0, 0.0)
    gravity: Vector = (0.0, 0.0, -9.81)
    slide: tuple[float, float] = (0.0, 0.0)
    plane: bool = False

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

    def vertices(self) -> FloatArray:
        """Return the samples as vertices (R * C, 3) [m], row by row."""
        row, column = np.divmod(np.arange(self.heights.size), self.heights.shape[1])
        (x, y), step = self.origin, self.resolution
        return np.column_stack([x + column * step, y + row * step, self.heights.ravel()])


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup(GroundSetup):
    """Bodies on a height map."""

    bodies: Sequence[EngineBody]


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
    def of(cls, rows: Sequence[Sequence[float]]) -> Self:
        """Return contacts from rows of body, point, normal, gap, velocity, normal force and friction."""
        bodies, points, normals, gaps, velocities, forces, frictions = np.split(
            np.array(rows, np.float64).reshape(-1, 15), (1, 4, 7, 8, 11, 12), axis=1
        )
        return cls(bodies[:, 0].astype(np.int64), points, normals, gaps[:, 0], velocities, forces[:, 0], frictions)


class Links(NamedTuple):
    """Frames of the links of N robots, or of N bodies, which are links by themselves: ``positions`` (N, L, 3) [m] and
    ``orientations`` (N, L, 4) (x, y, z, w)."""

    positions: FloatArray
    orientations: FloatArray

    @property
    def centres(self) -> FloatArray:
        """Return where robots or bodies are (N, 3) [m]: the mean of the frames of their links."""
        return np.asarray(self.positions.mean(axis=1))


class Simulation(ABC):
    """A simulation on moving ground in one engine. Call `close`, or use it as a context manager.

    The time of `set_ground` is the cost of updating the collider, because no other method does that; `step` runs the
    physics. Only an engine whose colliders follow the bodies also moves its colliders in `step`.
    """

    def ready(self, heights: Any) -> Any:
        """Return a map of heights (R, C) [m] in the engine's own format, for `set_ground`."""
        return np.asarray(heights, np.float64)

    @abstractmethod
    def set_ground(self, ready: Any) -> None:
        """Replace the map by what `ready` made of the current heights."""

    @abstractmethod
    def step(self) -> None:
        """Run one step of the setup's ``dt``."""

    @abstractmethod
    def velocities(self) -> FloatArray:
        """Return the velocities of the bodies in the world frame, linear (N, 3) [m/s] in front, angular [rad/s]
        after."""

    @abstractmethod
    def links(self) -> Links:
        """Return where the bodies are."""

    def contacts(self) -> Contacts | None:
        """Return the contacts with the ground in the last step, None if the engine does not tell their forces."""
        return None

    def close(self) -> None:  # noqa: B027  most engines leave nothing open
        """Release the simulation."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Engine(Simulation):
    """Simulation of the bodies of a `Setup`, with the engine's own options."""

    @abstractmethod
    def poses(self) -> FloatArray:
        """Return the poses of the bodies (N, 7): centres [m] in front, orientations (x, y, z, w) after."""

    def positions(self) -> FloatArray:
        """Return the centres of the bodies (N, 3) [m]."""
        return self.poses()[:, :3]

    def links(self) -> Links:
        poses = self.poses()[:, None]
        return Links(poses[..., :3], poses[..., 3:])


# Module and class of each engine, by its name: of bodies, and of robots.
ENGINES = {
    "smartmesh": "smartmesh.SmartMesh", "bullet_trimesh": "bullet.BulletTrimesh",
    "bullet_heightfield": "bullet.BulletHeightfield", "mujoco": "mujoco_hfield.MujocoHfield",
    "physx": "physx.PhysxTrimesh", "rapier": "rapier.RapierHeightfield", "smartmesh robots": "smartmesh.WorldRobots",
    "mujoco robots": "mujoco_hfield.MujocoRobots", "physx robots": "physx.PhysxRobots",
}  # fmt: skip


@cache
def missing(name: str) -> str:
    """Return the reason why an engine cannot be used here, "" = none; raise `InputError` for an unknown name."""
    if name not in ENGINES:
        raise InputError("engine", f"there is no engine {name!r}; choose {', '.join(ENGINES)}")
    try:
        import_module(f"studies.engines.{ENGINES[name].partition('.')[0]}")
    except (ImportError, OSError) as error:  # OSError: a library of the package's does not load
        return f"{type(error).__name__}: {error}"
    return ""


def build(name: str, setup: GroundSetup, **options: Any) -> Any:
    """Return a scene in the engine of that name; raises `InputError` if it is unknown or not installed."""
    reason = missing(name)
    if reason:
        raise InputError("engine", f"engine {name!r} is not available ({reason}); install requirements/studies.txt")
    module, kind = ENGINES[name].split(".")
    return getattr(import_module(f"studies.engines.{module}"), kind)(setup, **options)
