"""The scenes of robots as contests, and the distance of robots' links from the ground, by the library `coal`.

The ground is a prism below each triangle of the main mesh; a link is the shapes that its engine collides with.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import coal
import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import GridGeometry, PhysicsConfig
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.robots.meshes import obj_parts
from studies.configurations import Configuration
from studies.contest import FINE_RATE, Contest, Runner
from studies.engines.bullet import corrected_share
from studies.engines.smartmesh import WorldRobots
from studies.report.config import ReportConfig
from studies.robots.robot import STARTS, RobotEngine, RobotScene, RobotSetup, setup_of
from studies.robots.urdf import as_file

# Depth of the prisms [m]: deeper than any link sinks.
THICK = 1.0
# Largest distance from the ground that is measured [m].
REACH = 0.1
_IDENTITY = coal.Transform3s()


class Part:
    """A convex shape of a link: a geometry of `coal`, its ``pose`` in the link's frame, and ``points`` (8, 3) [m] in
    that frame, the corners of a box that contains it."""

    def __init__(self, geometry: Any, pose: Any) -> None:
        geometry.computeLocalAABB()
        bounds = np.array([geometry.aabb_local.min_, geometry.aabb_local.max_]).reshape(2, 3)
        corners = np.array(np.meshgrid(*bounds.T)).reshape(3, -1).T
        self.geometry, self.pose, self.points = geometry, pose, placed(corners, pose)


def hull_of(points: FloatArray) -> Any:
    """Return the convex hull of points (K, 3) [m] as a geometry of `coal`."""
    found = coal.StdVec_Vec3s()
    for point in np.asarray(points, np.float64):
        found.append(point)
    return coal.ConvexBase.convexHull(found, False, "Qt")


def placed(points: FloatArray, pose: Any) -> FloatArray:
    """Return points (K, 3) of a frame in that of its ``pose``."""
    return np.asarray(points @ pose.getRotation().T + pose.getTranslation())


def read_links(client: Any, uid: int, links: Sequence[int]) -> list[list[Part]]:
    """Return the shapes that PyBullet collides links of a body with, in the links' frames."""
    found: list[list[Part]] = []
    for link in links:
        inertial, parts = pose_of(*client.getDynamicsInfo(uid, link)[3:5]), list[Part]()
        found.append(parts)
        for index, shape in enumerate(client.getCollisionShapeData(uid, link)):
            kind, size, pose = shape[2], shape[3], inertial * pose_of(shape[5], shape[6])
            if kind == pb.GEOM_SPHERE:
                parts.append(Part(coal.Sphere(size[0]), pose))
            elif kind == pb.GEOM_BOX:
                parts.append(Part(coal.Box(*size), pose))
            elif kind == pb.GEOM_CYLINDER:
                parts.append(Part(coal.Cylinder(size[1], size[0]), pose))
            elif kind == pb.GEOM_CAPSULE:
                parts.append(Part(coal.Capsule(size[1], size[0]), pose))
            elif (file := Path(shape[4].decode())).suffix == ".obj" and len(objects := obj_parts(file)) > 1:
                # PyBullet gives the vertices of one object only.
                parts += [Part(hull_of(points * size), pose) for points in objects]
            else:  # the vertices of a mesh are given in the frame of the link's inertia
                points = np.array(client.getMeshData(uid, link, collisionShapeIndex=index)[1])
                parts.append(Part(hull_of(points), inertial))
    return found


def pose_of(position: Sequence[float], orientation: Sequence[float]) -> Any:
    """Return a pose of `coal` from a position [m] and a quaternion (x, y, z, w)."""
    return coal.Transform3s(rotated(np.array(orientation, np.float64), np.eye(3)).T, np.array(position))


class GroundPrisms:
    """The ground at one instant: a prism below each triangle, made when something is near it."""

    def __init__(self, geometry: GridGeometry, heights: FloatArray) -> None:
        self._geometry = geometry
        self._heights = np.asarray(heights, np.float64)
        z = self._heights
        corners = np.stack([z[:-1, :-1], z[1:, 1:], z[:-1, 1:], z[1:, :-1]])
        # Highest corner of both triangles of each cell (2, R - 1, C - 1).
        self._tops = np.stack([corners[:3].max(axis=0), corners[[0, 1, 3]].max(axis=0)])
        self._highest = float(self._tops.max())
        self._prisms: dict[tuple[int, int, int], Any] = {}

    def least_clearance(
        self, links: Sequence[Sequence[Part]], positions: FloatArray, orientations: FloatArray
    ) -> float:
        """Return the least distance [m] of L links at ``positions`` (L, 3) [m] and ``orientations`` (L, 4) from the
        ground, at most `REACH`; negative = penetration: how far the deepest overlap of a shape and a prism has to be
        moved apart. NaN if a link is beside the map."""
        least = REACH
        for index in np.argsort(positions[:, 2]):
            link = pose_of(positions[index], orientations[index])
            for part in links[index]:
                least = self._of_part(part, link, least)
        return float(least)

    def _of_part(self, part: Part, link: Any, least: float) -> float:
        """Return the distance [m] of a part from the ground, at most ``least``."""
        points = placed(part.points, link)
        low, high = points.min(axis=0), points.max(axis=0)
        # Nothing beside this window is nearer than what is known.
        reach = max(0.0, least)  # also where that is NaN
        corners = np.floor(self._geometry.to_grid(np.array([low[:2] - reach, high[:2] + reach]))).astype(int)
        most = np.array(self._heights.shape) - 2
        if (corners[1] < 0).any() or (corners[0] > most).any():
            return np.nan
        if low[2] - self._highest >= reach:
            return least
        (r0, c0), (r1, c1) = np.clip(corners, 0, most)
        # Lower bounds of the distances from the prisms (2, R, C): those along z alone.
        bounds = low[2] - self._tops[:, r0 : r1 + 1, c0 : c1 + 1]
        pose = link * part.pose
        result, request = coal.DistanceResult(), coal.DistanceRequest()
        for index in np.argsort(bounds, axis=None):
            half, row, column = np.unravel_index(index, bounds.shape)
            if bounds[half, row, column] >= max(0.0, least):
                break
            prism = self._prism(int(half), int(row + r0), int(column + c0))
            result.clear()
            least = min(least, coal.distance(part.geometry, pose, prism, _IDENTITY, request, result))
        return least

    def _prism(self, half: int, row: int, column: int) -> Any:
        key = (half, row, column)
        if key not in self._prisms:
            middle = (row, column + 1) if half == 0 else (row + 1, column)
            geometry = self._geometry
            cells = ((row, column), (row + 1, column + 1), middle)
            x, y, _ = geometry.origin
            top = [(x + c * geometry.resolution, y + r * geometry.resolution, self._heights[r, c]) for r, c in cells]
            bottom = [(px, py, min(height for *_, height in top) - THICK) for px, py, _ in top]
            self._prisms[key] = hull_of(np.array([*top, *bottom]))
        return self._prisms[key]


# Rate of the reference's maps [Hz]. The ground's velocity carries them in between.
MAPS = 240.0


class RobotContest(Contest):
    """A scene of robots."""

    scene: RobotScene
    pieces = 8
    patience: ClassVar[float] = 6.0

    def __init__(self, scene: RobotScene) -> None:
        super().__init__(scene, scene.ground, len(STARTS))
        self.timed_from = scene.settle
        self._parts: dict[str, list[list[Part]]] = {}  # of the links, by configuration

    def enter(self, configuration: Configuration) -> RobotEngine:
        setup = self._setup(configuration.rate)
        engine: RobotEngine = configuration.build(setup)
        if isinstance(engine, WorldRobots):
            body = next(iter(engine.world.bodies.values()))
            read = read_links(engine.world.client, body.uid, list(body.links))
            parts: Mapping[str, list[Part]] = dict(zip(body.links.values(), read, strict=True))
        else:
            parts = shapes_of(setup.text, prisms=engine.has_prisms)
        self._parts[configuration.name] = [parts[name] for name in engine.names]
        return engine

    def act(self, engine: Any, time: float) -> None:
        if self.scene.trot:
            engine.hold(self.scene.joints(time))

    def measure(self, instant: float, runners: Sequence[Runner]) -> None:
        surface = self.scene.surface(instant)
        prisms = GroundPrisms(surface.geometry, surface.heights)
        for runner in runners:
            sample, parts = runner.samples[instant], self._parts[runner.configuration.name]
            centres = sample.links.centres
            sample.below = ~(centres[:, 2] >= surface.below(centres))
            if instant > self.scene.settle:
                for robot, (positions, orientations) in enumerate(zip(*sample.links, strict=True)):
                    sample.clearance[robot] = prisms.least_clearance(parts, positions, orientations)

    def reference(self) -> FloatArray:
        """On ground at rest the collider is a triangle mesh of the whole map, without a filter of inner edges. On
        moving ground, where a whole collider has no velocity, it is ours, with an eighth of the step."""
        scene, setup = self.scene, self._setup(FINE_RATE)
        report = ReportConfig(kind="whole_trimesh") if not scene.map_rate else None
        every = round(FINE_RATE / MAPS)
        maps = range(every, round(FINE_RATE), every) if scene.map_rate else range(0)
        physics = PhysicsConfig(sleep=False, contact_erp=corrected_share(setup.dt))
        return self.places_in(WorldRobots(setup, report=report, physics=physics), scene.ground, maps)

    def _setup(self, rate: float) -> RobotSetup:
        """Return the robots for an engine that steps at ``rate`` [Hz]."""
        scene = self.scene
        return setup_of(scene.robot, scene.ground, scene.starts, rate, scene.speed)


def shapes_of(text: str, *, prisms: bool) -> Mapping[str, list[Part]]:
    """Return the shapes of a URDF's links by name: meshes as their hulls, and cylinders as cylinders or as prisms of 32
    sides."""
    client = BulletClient(pb.DIRECT)
    try:
        with as_file(text) as path:
            uid = client.loadURDF(path, flags=0 if prisms else pb.URDF_USE_IMPLICIT_CYLINDER)
        links = [link for link in range(-1, client.getNumJoints(uid)) if client.getCollisionShapeData(uid, link)]
        root = client.getBodyInfo(uid)[0]
        names = [(root if link < 0 else client.getJointInfo(uid, link)[12]).decode() for link in links]
        return dict(zip(names, read_links(client, uid, links), strict=True))
    finally:
        client.disconnect()
