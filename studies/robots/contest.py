"""Runs one scene in many engines in turns, and measures cost and accuracy of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from tempfile import NamedTemporaryFile
from time import process_time

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import BoolArray, deviation, held_up, penetration
from studies.contest import Result, result_of
from studies.reference import HORIZON
from studies.robots.bullet_robots import WorldRobots
from studies.robots.configurations import RobotConfiguration
from studies.robots.engine import Links, RobotEngine, RobotSetup
from studies.robots.geometry import GroundPrisms, Part, read_links
from studies.robots.reference import centres_of, reference_centres
from studies.robots.scene import STARTS, RobotScene
from studies.robots.urdf import prepared

# Length of a run, and its beginning that is not measured [s].
SECONDS, SETTLE = 2.0, 1.0
# Measurements in a second [Hz]: no multiple of the rate of the maps, so that they see maps of every age.
SAMPLES = 30.0
# Length of the pieces in which engines take turns [s]. The cost is the median over the pieces.
PIECE = 0.25
# Processor time in one scene after which an engine is stopped [s].
PATIENCE = 6.0


class Sample:
    """N robots at one instant: frames of their links, and a mask of supported robots (N,)."""

    def __init__(self, links: Links, held: BoolArray) -> None:
        self.links, self.held = links, held
        self.clearance = np.full(len(held), np.nan)
        self.below = np.zeros(len(held), bool)


class Runner:
    """One configuration in a scene: steps and times it, and records samples for measurements."""

    def __init__(self, scene: RobotScene, configuration: RobotConfiguration, setup: RobotSetup) -> None:
        self.configuration, self.note = configuration, ""
        self._scene = scene
        self._steps, self._map, self._used = 0, 0, 0.0
        self.times: list[float] = []  # of each piece, per simulated second [s]
        self.samples: dict[float, Sample] = {}
        self.engine = configuration.build(setup)
        parts = _parts_of(self.engine, setup)
        self.parts_in_order = [parts[name] for name in self.engine.names]

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._steps / self.configuration.rate

    def advance(self, until: float) -> float:
        """Step to ``until`` [s]; return the processor time [s]. Take a sample there."""
        engine, rate, scene = self.engine, self.configuration.rate, self._scene
        taken, before = 0.0, engine.velocities()
        while self._steps < round(until * rate):
            time = self.time
            number = math.floor(time * scene.map_rate + 1e-6)
            heights = None if number == self._map else scene.ground.heights(number / scene.map_rate)
            self._map = number
            if scene.trot is not None:
                engine.hold(scene.joints(time))
            before = engine.velocities() if self._steps == round(until * rate) - 1 else before
            start = process_time()
            if heights is not None:
                engine.set_ground(heights)
            engine.step()
            taken += process_time() - start
            self._steps += 1
        held = held_up(before, engine.velocities(), 1.0 / rate)
        self.samples[until] = Sample(engine.links(), held)
        self._used += taken
        if self._used > PATIENCE:
            self.note = f"stopped after {self.time:.2f} s: too slow"
        return taken

    def run_piece(self, instants: Sequence[float]) -> None:
        """Advance over the instants of a piece, and note what a simulated second took."""
        began, taken = self.time, 0.0
        for instant in instants:
            if not self.note:
                taken += self.advance(instant)
        if began >= SETTLE and self.time > began:
            self.times.append(taken / (self.time - began))


def run_scene(scene: RobotScene, chosen: Sequence[RobotConfiguration], say: Callable[[str], None]) -> dict[str, Result]:
    """Run a scene in every configuration, taking turns piece by piece."""
    text = prepared(scene.robot.urdf)
    results: dict[str, Result] = {}
    runners: list[Runner] = []
    for configuration in chosen:
        try:
            runners.append(Runner(scene, configuration, setup_of(scene, text, configuration.rate)))
        except (InputError, ValueError, RuntimeError) as error:
            results[configuration.name] = Result(bodies=len(STARTS), note=f"does not load: {error}")
    instants = np.arange(1, round(SECONDS * SAMPLES) + 1) / SAMPLES
    for part, piece in enumerate(np.array_split(instants, round(SECONDS / PIECE))):
        for runner in runners[part % len(runners) :] + runners[: part % len(runners)]:
            say(f"{scene.name} {piece[-1]:.2f} s: {runner.configuration.name}")
            runner.run_piece(piece.tolist())
        say(f"{scene.name} {piece[-1]:.2f} s: measures")
        _measure(scene, piece[piece > SETTLE].tolist(), runners)
    say(f"{scene.name}: reference")
    reference = reference_centres(scene, setup_of(scene, text, 8.0 * 240.0))
    for runner in runners:
        results[runner.configuration.name] = _result(runner, reference)
        runner.engine.close()
    return {configuration.name: results[configuration.name] for configuration in chosen}


def setup_of(scene: RobotScene, text: str, rate: float) -> RobotSetup:
    """Return the robots of a scene for an engine that steps at ``rate`` [Hz]."""
    ground = scene.ground
    return RobotSetup(
        robot=scene.robot, text=text, starts=scene.starts, heights=ground.heights(0.0), geometry=ground.geometry,
        dt=1.0 / rate, speed=scene.speed,
    )  # fmt: skip


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


def _measure(scene: RobotScene, instants: Sequence[float], runners: Sequence[Runner]) -> None:
    """Add to the samples the clearance of each robot's deepest link, and whether the robot is below the ground."""
    for instant in instants:
        surface = scene.surface(instant)
        prisms = GroundPrisms(surface.geometry, surface.heights)
        for runner in runners:
            sample = runner.samples.get(instant)
            if sample is None:
                continue
            for robot, (positions, orientations) in enumerate(zip(*sample.links, strict=True)):
                sample.clearance[robot] = prisms.least_clearance(runner.parts_in_order, positions, orientations)
            centres = centres_of(sample.links)
            sample.below = ~(centres[:, 2] >= surface.below(centres))


def _result(runner: Runner, reference: FloatArray) -> Result:
    measured = [sample for instant, sample in runner.samples.items() if instant > SETTLE]
    if not measured or not runner.times:
        return Result(bodies=len(STARTS), note=runner.note or "too slow to measure")
    found = penetration(
        np.array([sample.clearance for sample in measured]),
        np.array([sample.below for sample in measured]),
        np.array([sample.held for sample in measured]),
    )
    times = 1e6 / len(STARTS) * np.array(runner.times)
    apart = deviation(centres_of(runner.samples[HORIZON].links), reference)
    return result_of(found, times, apart, ran=runner.time, note=runner.note)
