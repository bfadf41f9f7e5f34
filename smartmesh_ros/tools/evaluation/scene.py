"""Scenes of the accuracy study: small YAML files that define the ground, its motion and the bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape, Sphere, shape_from
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.scenes.moving import Scene as MovingGround
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.tools.evaluation.clearance import skin
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.grounds import make_ground
from smartmesh_ros.yaml_text import parsed_yaml

FOLDER = Path(__file__).parent / "scenes"


@dataclass(frozen=True, kw_only=True)
class Bodies:
    """Bodies of one shape at random positions.

    ``count``: number of bodies. ``shape``, ``size`` [m]: of each. ``spread`` [m]: maximum distance from the middle of
    the map along x and y. ``drop`` [m]: initial height above the ground. ``velocity`` [m/s]: initial velocity.
    ``rolling``: spheres start rolling without slip.
    """

    count: int = 48
    shape: str = "sphere"
    size: tuple[float, ...] = (0.2,)
    spread: tuple[float, float] = (7.0, 7.0)
    drop: float = 0.05
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rolling: bool = False
    friction: float = 0.5

    def make_shape(self) -> Shape:
        """Return the shape of each body."""
        if self.shape not in SHAPES_BY_NAME:
            raise InputError("scene", f"there is no shape {self.shape!r}; choose {', '.join(SHAPES_BY_NAME)}")
        return shape_from(SHAPES_BY_NAME[self.shape], self.size)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A scene of the study.

    ``grid``: number of samples along each side and their distance [m]; sample (0, 0) lies at the origin. ``map_rate``
    [Hz]: rate of maps for the engines; 0 = one map. ``settle`` [s]: initial time that is not measured. ``samples``
    [Hz]: rate of measurements. ``slide`` [m/s]: velocity of the whole map along x and y, in addition to the motion of
    its ground. ``reference``: reference run, with an eighth of the step: a *whole* filtered collider for rigid ground,
    also sliding, or our *finest* setting with a map at every step. ``quick``: part of the quick run.
    """

    name: str
    title: str
    ground: dict[str, Any]
    grid: tuple[int, float]
    bodies: Bodies = field(default_factory=Bodies)
    map_rate: float = 240.0
    duration: float = 3.0
    settle: float = 0.5
    samples: float = 60.0
    slide: tuple[float, float] = (0.0, 0.0)
    reference: Literal["none", "whole", "finest"] = "finest"
    quick: bool = False

    @cached_property
    def geometry(self) -> GridGeometry:
        """Positions of the samples."""
        size, resolution = self.grid
        return GridGeometry(rows=size, columns=size, resolution=resolution)

    @property
    def moves(self) -> bool:
        """True if the ground moves."""
        return self.map_rate > 0.0

    def make_ground(self) -> MovingGround:
        """Return new ground, because some ground keeps its deformation."""
        return make_ground(self.geometry, **self.ground)

    def surface(self, heights: Any, time: float = 0.0) -> Surface:
        """Return the main mesh of a map of heights at its position at ``time`` [s]."""
        x, y = self.slide[0] * time, self.slide[1] * time
        return Surface(replace(self.geometry, origin=(x, y, 0.0)), np.asarray(heights))

    def starts(self) -> list[BodyState]:
        """Return the initial states of the bodies, which are at least a bounding diameter apart."""
        bodies = self.bodies
        apart = 2.0 * bodies.make_shape().bounding_radius
        rng = np.random.default_rng(5)
        places: list[FloatArray] = []
        middle = 0.5 * (self.grid[0] - 1) * self.grid[1]
        for _ in range(100_000):
            if len(places) == bodies.count:
                break
            place = middle + rng.uniform(-1.0, 1.0, 2) * bodies.spread
            if all(np.hypot(*(place - other)) >= apart for other in places):
                places.append(place)
        if len(places) < bodies.count:
            raise InputError("scene", f"{bodies.count} bodies do not fit into {bodies.spread} m; raise spread")
        xy = np.array(places)
        surface = self.surface(self.make_ground().heights(0.0))
        low = lowest(surface, bodies.make_shape(), xy) + bodies.drop
        spin = 1.0 / bodies.size[0] if bodies.rolling else 0.0
        angular = (-bodies.velocity[1] * spin, bodies.velocity[0] * spin, 0.0)
        return [
            BodyState((float(x), float(y), float(z)), linear=bodies.velocity, angular=angular)
            for (x, y), z in zip(xy, low, strict=True)
        ]


def lowest(surface: Surface, shape: Shape, xy: FloatArray) -> FloatArray:
    """Return the lowest heights (N,) [m] of the centres of upright bodies at (N, 2) [m] without penetration."""
    reach = shape.bounding_radius
    offsets = np.linspace(-reach, reach, 9)
    dx, dy = (axis.ravel() for axis in np.meshgrid(offsets, offsets))
    if isinstance(shape, Sphere):
        keep = dx**2 + dy**2 <= reach**2
        dx, dy = dx[keep], dy[keep]
        drop = np.sqrt(np.maximum(reach**2 - dx**2 - dy**2, 0.0))
    else:
        body = skin(shape)
        drop = np.full(len(dx), body.radius - body.points[:, 2].min())
    points = np.zeros((len(xy), len(dx), 3))
    points[..., 0], points[..., 1] = xy[:, :1] + dx, xy[:, 1:] + dy
    ground = surface.below(points.reshape(-1, 3)).reshape(len(xy), -1)
    return np.asarray(np.nanmax(ground + drop, axis=1))


def read_scene(path: Path) -> Scene:
    """Return the scene of a YAML file; raises `InputError` for missing or unknown fields, and for values that cannot
    be."""
    try:
        loaded = parsed_yaml(path.read_text())
        bodies = Bodies(**_as_tuples(loaded.pop("bodies", {})))
        found = Scene(name=path.stem, bodies=bodies, **_as_tuples(loaded))
        lengths = (*found.grid, *found.slide, *bodies.size, *bodies.spread, *bodies.velocity)
        numbers = np.array([*lengths, found.map_rate, found.settle, found.samples, bodies.drop, bodies.friction], float)
        above_zero = 0.0 < found.duration < math.inf and bodies.count > 0
        if not (above_zero and np.isfinite(numbers).all() and "kind" in {**found.ground}):
            raise ValueError("numbers must be finite, duration and count above zero, and the ground has a kind")
    except (AttributeError, TypeError, OSError, ValueError) as error:
        raise InputError("scene", f"{path.name} is no scene such as {FOLDER}/flat.yaml: {error}") from None
    return found


def _as_tuples(mapping: dict[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in mapping.items()}


def read_scenes() -> list[Scene]:
    """Return all scenes that come with the package, sorted by name."""
    return [read_scene(path) for path in sorted(FOLDER.glob("*.yaml"))]
