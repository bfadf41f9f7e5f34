"""The scenes of the study of robots as contests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from tempfile import NamedTemporaryFile
from typing import Any, ClassVar

import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.configurations import Configuration
from studies.contest import Contest, Result, Rules, Runner, run
from studies.robots.bullet_robots import WorldRobots
from studies.robots.configurations import build
from studies.robots.engine import Links, RobotEngine, RobotSetup
from studies.robots.geometry import GroundPrisms, Part, read_links
from studies.robots.reference import centres_of, reference_centres
from studies.robots.scene import STARTS, RobotScene
from studies.robots.urdf import prepared

# Length of a run, and its beginning that is not measured [s]; pieces, and processor time until an engine is stopped
# [s]. Measurements in a second [Hz]: no multiple of the rate of the maps, so that they see maps of every age.
SECONDS, SETTLE, PIECES, PATIENCE, SAMPLES = 2.0, 1.0, 8, 6.0, 30.0


class RobotContest(Contest):
    """A scene of robots."""

    tells_update: ClassVar[bool] = False

    def __init__(self, scene: RobotScene) -> None:
        rules = Rules(
            name=scene.name, bodies=len(STARTS), duration=SECONDS, settle=SETTLE, samples=SAMPLES, pieces=PIECES,
            patience=PATIENCE, map_rate=scene.map_rate, timed_from=SETTLE,
        )  # fmt: skip
        super().__init__(rules, scene.ground)
        self._scene = scene
        self._text = prepared(scene.robot.urdf)
        self._parts: dict[str, list[list[Part]]] = {}  # of the links, by configuration

    def enter(self, configuration: Configuration) -> RobotEngine:
        setup = self._setup(configuration.rate)
        try:
            engine = build(configuration, setup)
        except (ValueError, RuntimeError) as error:
            raise InputError("robot", f"does not load: {error}") from error
        parts = _parts_of(engine, setup)
        self._parts[configuration.name] = [parts[name] for name in engine.names]
        return engine

    def handing(self, configuration: Configuration, engine: Any, heights: Any) -> Callable[[], None]:
        return lambda: engine.set_ground(heights)

    def act(self, engine: Any, time: float) -> None:
        if self._scene.trot is not None:
            engine.hold(self._scene.joints(time))

    def state(self, engine: RobotEngine) -> Links:
        return engine.links()

    def measure(self, instant: float, runners: Sequence[Runner]) -> None:
        surface = self._scene.surface(instant)
        prisms = GroundPrisms(surface.geometry, surface.heights)
        for runner in runners:
            sample, parts = runner.samples[instant], self._parts[runner.configuration.name]
            centres = centres_of(sample.state)
            sample.below = ~(centres[:, 2] >= surface.below(centres))
            if instant > SETTLE:
                for robot, (positions, orientations) in enumerate(zip(*sample.state, strict=True)):
                    sample.clearance[robot] = prisms.least_clearance(parts, positions, orientations)

    def centres(self, state: Links) -> FloatArray:
        return centres_of(state)

    def reference(self) -> FloatArray:
        return reference_centres(self._scene, self._setup(8.0 * 240.0))

    def _setup(self, rate: float) -> RobotSetup:
        """Return the robots for an engine that steps at ``rate`` [Hz]."""
        scene, ground = self._scene, self._scene.ground
        return RobotSetup(
            robot=scene.robot, text=self._text, starts=scene.starts, heights=ground.heights(0.0),
            geometry=ground.geometry, dt=1.0 / rate, speed=scene.speed,
        )  # fmt: skip


def run_scene(scene: RobotScene, chosen: Sequence[Configuration], say: Callable[[str], None]) -> dict[str, Result]:
    """Run a scene in every configuration."""
    return run(RobotContest(scene), chosen, say)


def _parts_of(engine: RobotEngine, setup: RobotSetup) -> Mapping[str, list[Part]]:
    """Return the shapes of links by name, as the engine has them."""
    if isinstance(engine, WorldRobots):
        body = next(iter(engine.world.bodies.values()))
        parts = read_links(engine.world.client, body.uid, list(body.links))
        return dict(zip(body.links.values(), parts, strict=True))
    return shapes_of(setup.text, prisms=engine.has_prisms)


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
