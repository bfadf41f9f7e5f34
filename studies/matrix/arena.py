"""Rows and columns of the stability matrix, and a world on moving ground with what the rows measure."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np

from smartmesh_ros import BodyState, GridGeometry, HeightMap, MotionConfig, PhysicsConfig, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.scenes.moving import Scene
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.grounds import Rigid, make_ground
from studies.configurations import BARE
from studies.engines.smartmesh import NEVER_LOST
from studies.report.config import ReportConfig
from studies.report.ground import world_on
from studies.robots import robot

HUSKY = robot.HUSKY.urdf


def square(size: int, resolution: float) -> GridGeometry:
    """A square map around the origin."""
    half = 0.5 * (size - 1) * resolution
    return GridGeometry(rows=size, columns=size, resolution=resolution, origin=(-half, -half, 0.0))


# Height [m] at positions (1, C) and (R, 1) [m].
Heights = Callable[[FloatArray, FloatArray], Any]


class Arena:
    """Bodies on one height map that follows a ground function. Use it as a context manager.

    ``ground``: a scene, or name and settings as in `make_ground`; or, of ground at rest, heights (R, C) [m] or a
    function height(x, y) [m] of positions (1, C) and (R, 1) [m]. ``map_rate`` [Hz]: rate of maps; 0 = one map.
    ``motion``: how maps are processed.
    """

    def __init__(
        self, method: "Method", ground: Any = 0.0, *, size: int = 61, resolution: float = 0.25, map_rate: float = 0.0,
        physics: PhysicsConfig | None = None, motion: MotionConfig | None = None,
    ) -> None:  # fmt: skip
        self.geometry = square(size, resolution)
        if isinstance(ground, Scene):
            self.ground, self.geometry = ground, ground.geometry
        else:
            named = isinstance(ground, dict)
            self.ground = make_ground(self.geometry, **ground) if named else Rigid(self.geometry, ground)
        self.heightmap = HeightMap(self.ground.heights(0.0), geometry=self.geometry, motion=motion)
        config = WorldConfig(physics=physics or PhysicsConfig(), falls=NEVER_LOST)
        self.world = world_on(self.heightmap, config, method)
        self.shapes: dict[str, Shape] = {}
        self._map_rate = map_rate
        self._map = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.world.close()

    def spawn(self, name: str, shape: Shape, position: tuple[float, float, float], **state: Any) -> None:
        """Adds a body of 1 kg."""
        self.world.spawn(name, shape, 1.0, BodyState(position, **state))
        self.shapes[name] = shape

    def rest_of(self, shape: Shape, position: tuple[float, float, float], seconds: float = 1.0) -> FloatArray:
        """Return where a body is (3,) [m] so many seconds after it was put down at a ``position``."""
        self.spawn("body", shape, position)
        self.settle(seconds)
        return np.asarray(self.positions()[0])

    def tell(self, heights: Any) -> None:
        """Replace the map by heights (R, C) [m] of now."""
        self.heightmap.replace(heights, time=self.world.time)

    def scatter(self, count: int, shape: Shape, spread: float, drop: float, seed: int = 5, **state: Any) -> None:
        """Adds bodies at random places within ``spread`` [m] of the middle, ``drop`` [m] above the ground there."""
        places = np.random.default_rng(seed).uniform(-spread, spread, (count, 2))
        heights = self.heightmap.at(places, 0.0).heights
        for index, ((x, y), z) in enumerate(zip(places.tolist(), heights.tolist(), strict=True)):
            self.spawn(f"body_{index}", shape, (x, y, z + drop), **state)

    def run(self, seconds: float) -> Iterator[float]:
        """Step for a time [s]; yield the time after every step [s]."""
        for _ in range(round(seconds * self.world.config.physics.rate)):
            number = math.floor(self.world.time * self._map_rate + 1e-6)
            if number != self._map:
                self.tell(self.ground.heights(self.world.time))
                self._map = number
            self.world.step()
            yield self.world.time

    def settle(self, seconds: float) -> None:
        """Steps through so many seconds."""
        for _ in self.run(seconds):
            pass

    def most(self, seconds: float, figure: Callable[[], float]) -> float:
        """Return the largest figure after any step of a time [s]."""
        return max(figure() for _ in self.run(seconds))

    def drift(self, settle: float, seconds: float) -> float:
        """Return how far [mm] the last body moves in a time [s], after another in which it comes to rest."""
        self.settle(settle)
        before = self.positions()[-1]
        self.settle(seconds)
        return 1e3 * math.dist(before, self.positions()[-1])

    def _poses(self) -> tuple[FloatArray, FloatArray]:
        """Return centres (N, 3) [m] and orientations (N, 4) of the bodies."""
        states = [self.world.client.getBasePositionAndOrientation(self.world.bodies[name].uid) for name in self.shapes]
        return np.array([position for position, _ in states]), np.array([turn for _, turn in states])

    def positions(self) -> FloatArray:
        """Centres of the bodies (N, 3) [m]."""
        return self._poses()[0]

    def velocities(self) -> FloatArray:
        """Their velocities (N, 3) [m/s]."""
        return np.array([self.world.client.getBaseVelocity(self.world.bodies[name].uid)[0] for name in self.shapes])

    def surface(self) -> Surface:
        """The main mesh as it truly is now."""
        return Surface(self.geometry, np.asarray(self.ground.heights(self.world.time), np.float64))

    def clearances(self) -> FloatArray:
        """Distance of the bodies' surfaces from the ground (N,) [m]; all bodies must be of one shape."""
        return clearances(self.surface(), next(iter(self.shapes.values())), *self._poses())

    def lost(self) -> set[int]:
        """Return the numbers of the bodies whose centre is below the ground."""
        positions = self.positions()
        return set(np.flatnonzero(positions[:, 2] < self.surface().below(positions)).tolist())


Place = tuple[float, float, float]
ANY = math.nan  # in a place: anywhere along that axis


def off(
    shape: Shape, start: Place, place: Place, method: "Method", seconds: float = 1.0, state: Any = None, **more: Any
) -> float:
    """Distance [mm] of a body from the ``place`` where it should be so many seconds after its ``start`` [m], with
    further parts of its ``state``, in an arena with ``more`` settings."""
    with Arena(method, **more) as arena:
        arena.spawn("body", shape, start, **(state or {}))
        arena.settle(seconds)
        return 1e3 * float(np.sqrt(np.nansum(np.square(arena.positions()[0] - place))))


def deepest(arena: Arena, seconds: float, settle: float, every: int = 4, share: float = 99.0) -> float:
    """Penetration [mm], so many per cent, over a run; infinite where a body is lost."""
    depths = []
    for step, time in enumerate(arena.run(seconds)):
        if time > settle and step % every == 0:
            if arena.lost():
                return math.inf
            depths.append(-arena.clearances())
    return max(1e3 * float(np.nanpercentile(depths, share)), 0.0)


def lost_in(arena: Arena, seconds: float) -> float:
    """How many bodies have their centre below the ground at any eighth step of a run."""
    gone: set[int] = set()
    for step, _ in enumerate(arena.run(seconds)):
        if step % 8 == 7:
            gone |= arena.lost()
    return float(len(gone))


# The report's colliders; None = contacts from the map.
Method = ReportConfig | None
Figure = Callable[[Method], float]

METHODS: dict[str, Method] = {
    "defaults": None,
    "heightfield": ReportConfig(kind="heightfield"),
    "rebuilt trimesh": ReportConfig(kind="trimesh", **BARE),
    "convex hull": ReportConfig(kind="hull", **BARE),
    "whole trimesh": ReportConfig(kind="whole_trimesh", **BARE),
    "whole heightfield": ReportConfig(kind="whole_heightfield", **BARE),
}


@dataclass(frozen=True)
class Row:
    """One test: ``figure`` of a method must not exceed ``limit`` [``unit``].

    ``source``: where the limit comes from. ``quick``: part of the quick run, and of the tests for the defaults.
    ``skip``: methods it makes no sense for, or that take too long.
    """

    name: str
    figure: Figure
    limit: float
    unit: str
    source: str
    quick: bool = False
    skip: tuple[str, ...] = ()


# A row for the defaults alone: the other methods are there for their colliders' sake.
own_row = partial(Row, skip=tuple(name for name in METHODS if name != "defaults"))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A cell: ``figure`` in the row's unit, None = not run; infinite = lost or not reached."""

    row: Row
    method: str
    figure: float | None

    @property
    def passed(self) -> bool | None:
        """Return True if the figure is within the limit; None if there is no figure."""
        return None if self.figure is None else bool(self.figure <= self.row.limit)

    def record(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        row = self.row
        found = {"row": row.name, "method": self.method, "figure": self.figure}
        return {**found, "limit": row.limit, "unit": row.unit, "source": row.source}
