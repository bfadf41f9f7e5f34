"""Random shapes over random ground, their contacts by the core, and their distances by the library coal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pybullet_data
from numpy.typing import ArrayLike

from smartmesh_ros import HeightMap
from smartmesh_ros.core import _core
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.terrain.surfaces import facet_distances, mesh_of, triangles_of

IDENTITY = coal.Transform3s(np.eye(3), np.zeros(3))
# Sides of the polygon that stands for a circle where coal gives cylinders no depth [-]. Its error is 0.1 mm at a radius
# of a metre.
SIDES = 200
# Samples of level ground around the random ones, so that no shape reaches beyond the map's edge.
RIM = 6
SHAPES = ("ball", "capsule", "box", "cylinder", "hull", "wheel", "turned wheel", "lattice", "mesh")


def contacts_of(
    shape: Any, ground: HeightMap | TriangleMesh, turn: np.ndarray, at: ArrayLike, margin: float,
    motion: ArrayLike = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), duration: float = 1.0 / 240.0,
) -> np.ndarray:  # fmt: skip
    """Returns the contacts, one a row, of a shape at a pose in a step of a ``duration`` [s]. ``motion``: velocity [m/s]
    and angular velocity [rad/s]; ``margin`` [m]: distance up to which contacts are looked for."""
    pose = np.vstack([turn, at])
    return np.asarray(_core.find_contacts(shape, [ground.core_reader], pose, np.array(motion), duration, margin))


def vectors(points: np.ndarray) -> Any:
    made = coal.StdVec_Vec3s()
    for point in points:
        made.append(np.array(point))
    return made


def coal_hull(points: np.ndarray) -> Any:
    return coal.ConvexBase.convexHull(vectors(points), True, "Qt")


def coal_triangle(corners: np.ndarray) -> Any:
    triangles = coal.StdVec_Triangle()
    triangles.append(coal.Triangle(0, 1, 2))
    return coal.Convex(vectors(corners), triangles)


# Coal's settings, exact to rounding.
REQUEST = coal.DistanceRequest()
REQUEST.gjk_tolerance, REQUEST.gjk_max_iterations = 1e-10, 1000
REQUEST.epa_tolerance, REQUEST.epa_max_iterations = 1e-9, 500


def distance(one: Any, one_pose: Any, other: Any, other_pose: Any) -> float:
    return float(coal.distance(one, one_pose, other, other_pose, REQUEST, coal.DistanceResult()))


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    found, upper = np.linalg.qr(rng.standard_normal((3, 3)))
    found = found * np.sign(np.diag(upper))
    return np.ascontiguousarray(found * np.linalg.det(found))


def wheel(radius: float, width: float, sides: int = 32) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.concatenate([np.column_stack([rim, np.full(sides, z)]) for z in (-0.5 * width, 0.5 * width)])


def lattice() -> np.ndarray:
    """Points inside, on the faces and on the edges of a box."""
    ways = np.linspace(-1.0, 1.0, 5)
    return np.stack(np.meshgrid(ways, 0.6 * ways, 0.4 * ways), axis=-1).reshape(-1, 3)


@cache
def mesh() -> np.ndarray:
    """Points of a robot's body, many of them nearly in one plane: the husky's of PyBullet."""
    data = (Path(pybullet_data.getDataPath()) / "husky/meshes/base_link.stl").read_bytes()
    triangles = np.frombuffer(data[84:], [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    points = np.unique(triangles["corners"].reshape(-1, 3).astype(np.float64), axis=0)
    return np.asarray(points - points.mean(axis=0))


@dataclass(frozen=True)
class Body:
    """A shape of the core and the same of coal's; ``deep``: coal's for depths. ``reach`` [m]: from its origin."""

    core: Any
    coal: Any
    deep: Any
    reach: float
    half: np.ndarray  # of its box


def body_of_points(points: np.ndarray) -> Body:
    made = coal_hull(points)
    reach = float(np.linalg.norm(points, axis=1).max())
    return Body(BodyShape.hull(points, 0.0), made, made, reach, np.abs(points).max(axis=0))


def body(name: str, size: float, rng: np.random.Generator) -> Body:
    """Returns a shape whose extents are about ``size`` [m]."""
    a, b, c = (size * np.exp(rng.uniform(-1.2, 0.3, 3))).tolist()
    if name == "ball":
        made = coal.Sphere(a)
        return Body(BodyShape.ball(a), made, made, a, np.full(3, a))
    if name == "capsule":
        made = coal.Capsule(a, 2.0 * b)
        return Body(BodyShape.capsule(a, 2.0 * b), made, made, a + b, np.array([a, a, a + b]))
    if name == "box":
        edges = (2.0 * a, 2.0 * b, 2.0 * c)
        made = coal.Box(*edges)
        return Body(BodyShape.box(edges), made, made, float(np.hypot(np.hypot(a, b), c)), np.array([a, b, c]))
    if name == "cylinder":
        deep = coal_hull(wheel(a, 2.0 * b, SIDES))
        core = BodyShape.cylinder(a, 2.0 * b)
        return Body(core, coal.Cylinder(a, 2.0 * b), deep, float(np.hypot(a, b)), np.array([a, a, b]))
    if name in ("lattice", "mesh"):
        points = (lattice() @ random_rotation(rng).T) if name == "lattice" else mesh()
        single = np.unique((points * (size / np.abs(points).max())).astype(np.float32), axis=0)
        return body_of_points(single.astype(np.float64))
    if name == "hull":
        return body_of_points(rng.normal(size=(int(rng.integers(4, 30)), 3)) * (a, b, c) * 0.5)
    turn = random_rotation(rng) if name == "turned wheel" else np.eye(3)
    return body_of_points((wheel(a, 0.5 * b) @ turn.T).astype(np.float32).astype(np.float64))


class Facets:
    """Triangles (F, 3, 3) [m], for coal, which get them when they are asked for."""

    def __init__(self, corners: np.ndarray) -> None:
        self.corners, self.low, self.high = corners, corners.min(axis=1), corners.max(axis=1)
        self.made: dict[int, Any] = {}

    def distance(self, shape: Any, turn: np.ndarray, at: np.ndarray, extent: Any) -> float:
        """Returns the least signed distance of coal's shape from the triangles in the box of an ``extent`` [m] around
        it, infinite if there are none."""
        pose, least = coal.Transform3s(turn, at), np.inf
        for k in np.flatnonzero(np.all((self.low <= at + extent) & (self.high >= at - extent), axis=1)).tolist():
            if k not in self.made:
                self.made[k] = coal_triangle(self.corners[k])
            least = min(least, distance(self.made[k], IDENTITY, shape, pose))
        return least


@dataclass(frozen=True)
class Ground:
    """A height map with its origin at zero. ``heights`` (rows, columns) float32 [m]."""

    heights: np.ndarray
    resolution: float
    yaw: float

    @cached_property
    def heightmap(self) -> HeightMap:
        return HeightMap(self.heights, resolution=self.resolution, yaw=self.yaw)

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The same ground as a mesh."""
        return mesh_of(self.heightmap)

    @cached_property
    def points(self) -> np.ndarray:
        """Samples (rows * columns, 3) [m]."""
        return self.mesh.vertices

    @cached_property
    def corners(self) -> np.ndarray:
        """Corners of the facets (F, 3, 3) [m]."""
        return triangles_of(self.heightmap, 0.0)

    @cached_property
    def facets(self) -> Facets:
        return Facets(self.corners)

    def touching(self, point: np.ndarray) -> np.ndarray:
        """Returns the facets that a point [m] lies on."""
        return self.corners[facet_distances(self.corners, point[None])[0] < 1e-7]


def random_ground(rng: np.random.Generator) -> Ground:
    resolution = float(rng.choice([0.02, 0.05, 0.1, 0.3]))
    rows, columns = rng.integers(3, 9, 2)
    heights = rng.standard_normal((rows, columns)) * rng.choice([0.0, 0.003, 0.03, 0.2, 0.6, 1.5]) * resolution
    if rng.random() < 0.3:
        v, u = np.mgrid[:rows, :columns] * resolution
        heights = heights + rng.normal() * u + rng.normal() * v
    padded = np.pad(heights, RIM, mode="edge").astype(np.float32)
    return Ground(padded, resolution, float(rng.uniform(-3.0, 3.0)) if rng.random() < 0.5 else 0.0)


@dataclass(frozen=True)
class Case:
    """A body at a pose over some ground. ``margin`` [m]: distance up to which contacts are looked for."""

    ground: Ground
    body: Body
    turn: np.ndarray
    position: np.ndarray
    margin: float

    def moved(self, by: np.ndarray) -> Case:
        return Case(self.ground, self.body, self.turn, self.position + by, self.margin)

    def contacts(self, way: ArrayLike = (0.0, 0.0, 0.0), *, with_mesh: bool = False) -> np.ndarray:
        """Returns the contacts in a step of one second, in which the body goes a ``way`` [m]."""
        ground, motion = self.ground.mesh if with_mesh else self.ground.heightmap, (way, (0.0, 0.0, 0.0))
        return contacts_of(self.body.core, ground, self.turn, self.position, self.margin, motion, 1.0)

    def distance(self, within: float, deep: bool = False) -> float:
        """Returns coal's least signed distance [m] from the facets, infinite if it is above ``within`` [m]."""
        extent = np.abs(self.turn) @ self.body.half + within
        return self.ground.facets.distance(self.body.deep if deep else self.body.coal, self.turn, self.position, extent)


def placed(case: Case, rng: np.random.Generator) -> Case:
    """Returns the case with its body lowered to the ground or a little into it."""
    for _ in range(int(rng.integers(3, 9))):
        step = case.ground.resolution
        case = case.moved(np.array([0.0, 0.0, -min(max(case.distance(step), 0.0), step)]))
    return case.moved(np.array([0.0, 0.0, rng.uniform(-0.2, 0.1 if rng.random() < 0.5 else 1.0) * case.margin]))


def random_case(name: str, ground: Ground, rng: np.random.Generator) -> Case:
    resolution = ground.resolution
    shape = body(name, resolution * float(rng.choice([0.3, 1.0, 2.0])), rng)
    rows, columns = ground.heights.shape
    u, v = RIM + rng.uniform(0.0, 1.0, 2) * (np.array([columns, rows]) - 1 - 2 * RIM)
    xy = ground.heightmap.geometry.to_world(v, u)
    beside = np.linalg.norm(ground.points[:, :2] - xy, axis=1) <= shape.reach + 2.0 * resolution
    top = float(ground.points[beside, 2].max())
    turn = np.eye(3) if rng.random() < 0.2 else random_rotation(rng)
    margin = resolution * float(rng.choice([0.05, 0.3]))
    height = top + float(np.abs(turn[2]) @ shape.half) + rng.uniform(0.0, margin)
    return placed(Case(ground, shape, turn, np.array([xy[0], xy[1], height]), margin), rng)


def convex_ground(rng: np.random.Generator) -> Ground:
    """Returns ground that is convex at every edge, also at the diagonals of its cells."""
    resolution, across = float(rng.choice([0.05, 0.2])), rng.uniform(0.0, 0.05)
    v, u = np.mgrid[: 2 * RIM + 4, : 2 * RIM + 4] - (RIM + 1.5)
    bent = (across + rng.uniform(0.005, 0.1)) * u**2 + (across + rng.uniform(0.005, 0.1)) * v**2 - 2.0 * across * u * v
    heights = resolution * (rng.normal(scale=0.3) * u + rng.normal(scale=0.3) * v - bent)
    return Ground(heights.astype(np.float32), resolution, float(rng.uniform(-3.0, 3.0)))


def solid(ground: Ground) -> Any:
    """Returns convex ground as coal's hull, deep below its surface."""
    below = ground.points - np.array([0.0, 0.0, 100.0 * ground.resolution])
    return coal_hull(np.concatenate([ground.points, below]))
