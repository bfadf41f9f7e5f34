"""The scenes of the study of robots as contests."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from tempfile import NamedTemporaryFile
from typing import Any, ClassVar

import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.terrain.grid import FloatArray
from studies.configurations import Configuration
from studies.contest import FINE_RATE, HORIZON, Contest, Runner
from studies.engines.smartmesh import WorldRobots
from studies.report.config import ReportConfig
from studies.robots.engine import RobotEngine, RobotSetup, setup_of
from studies.robots.geometry import GroundPrisms, Part, read_links
from studies.robots.scene import STARTS, RobotScene

# Rate of the reference's maps [Hz]. The ground's velocity carries them in between.
MAPS = 240.0


class RobotContest(Contest):
    """A scene of robots."""

    scene: RobotScene
    pieces = 8
    patience: ClassVar[float] = 6.0
    tells_update: ClassVar[bool] = False

    def __init__(self, scene: RobotScene) -> None:
        super().__init__(scene, scene.ground, len(STARTS))
        self.timed_from = scene.settle
        self._parts: dict[str, list[list[Part]]] = {}  # of the links, by configuration

    def enter(self, configuration: Configuration) -> RobotEngine:
        setup = self._setup(configuration.rate)
        try:
            engine: RobotEngine = configuration.build(setup)
        except (ValueError, RuntimeError) as error:
            raise InputError("robot", f"does not load: {error}") from error
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
        report = ReportConfig(kind="whole_trimesh") if scene.motion == "rest" else None
        with WorldRobots(setup, report=report, physics=PhysicsConfig(sleep=False)) as engine:
            for step in range(math.floor(HORIZON / setup.dt + 0.5)):
                time = step * setup.dt
                self.act(engine, time)
                if scene.map_rate and step and step % round(1.0 / (setup.dt * MAPS)) == 0:
                    engine.set_ground(scene.ground.heights(time))
                engine.step()
            return engine.links().centres

    def _setup(self, rate: float) -> RobotSetup:
        """Return the robots for an engine that steps at ``rate`` [Hz]."""
        scene = self.scene
        return setup_of(scene.robot, scene.ground, scene.starts, rate, scene.speed)


def shapes_of(text: str, *, prisms: bool) -> Mapping[str, list[Part]]:
    """Return the shapes of a URDF's links by name: meshes as their hulls, and cylinders as cylinders or as prisms of 32
    sides."""
    client = BulletClient(pb.DIRECT)
    try:
        with NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(text)
            file.flush()
            uid = client.loadURDF(file.name, flags=0 if prisms else pb.URDF_USE_IMPLICIT_CYLINDER)
        links = [link for link in range(-1, client.getNumJoints(uid)) if client.getCollisionShapeData(uid, link)]
        root = client.getBodyInfo(uid)[0]
        names = [(root if link < 0 else client.getJointInfo(uid, link)[12]).decode() for link in links]
        return dict(zip(names, read_links(client, uid, links), strict=True))
    finally:
        client.disconnect()
