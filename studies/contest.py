"""Runs one scene in many engines in turns, and measures cost and accuracy of each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import process_time
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import clearances
from smartmesh_ros.tools.evaluation.measures import BoolArray, Penetration, deviation, held_up, penetration
from smartmesh_ros.tools.evaluation.scene import Scene
from studies.configurations import Configuration
from studies.engines.checkout import Checkout
from studies.engines.engine import EngineBody, Setup
from studies.engines.registry import build
from studies.reference import HORIZON, reference_positions

# Number of pieces of a run, in which all engines take turns. The cost is the median over the pieces.
PIECES = 12
# Processor time in one scene after which an engine is stopped [s].
PATIENCE = 2.5


@dataclass(frozen=True, kw_only=True)
class Result:
    """One configuration in one scene.

    ``cost`` [us]: processor time of update and step, per body and simulated second, median; ``spread``: its quartiles
    [us]; ``update``: the ground's share of it [us]. Then `Penetration`'s figures [m]; deviation from the reference
    after one second, median and largest over the bodies [m], NaN = none; how long it ran [s]; ``note``: why it did not
    run, or not long.
    """

    cost: float = math.nan
    spread: tuple[float, float] = (math.nan, math.nan)
    update: float = math.nan
    p50: float = math.nan
    p99: float = math.nan
    most: float = math.nan
    hover: float = math.nan
    lost: int = 0
    bodies: int = 0
    deviation: float = math.nan
    most_deviation: float = math.nan
    ran: float = 0.0
    note: str = ""


@dataclass
class Sample:
    """N bodies at one instant: centres (N, 3) [m], orientations (N, 4), mask of supported bodies (N,); after measuring
    also clearance (N,) [m] and a mask of bodies whose centre is below the ground (N,)."""

    positions: FloatArray
    orientations: FloatArray
    held: BoolArray
    clearance: FloatArray | None = None
    below: BoolArray | None = None


class Maps:
    """The maps of a scene by their number, made once for all engines."""

    def __init__(self, scene: Scene) -> None:
        self._ground = scene.make_ground()
        self._rate = scene.map_rate
        self._maps: dict[int, Any] = {}

    def __call__(self, number: int) -> Any:
        if number not in self._maps:
            self._maps[number] = self._ground.heights(number / self._rate if self._rate else 0.0)
        return self._maps[number]

    def forget(self, before: int) -> None:
        """Frees the maps with lower numbers."""
        for number in [number for number in self._maps if number < before]:
            del self._maps[number]


class Runner:
    """One configuration in a scene: steps and times it, and records samples for measurements."""

    def __init__(self, scene: Scene, configuration: Configuration, maps: Maps) -> None:
        self.configuration = configuration
        self.note = ""
        self._scene = scene
        self._maps = maps
        self._steps = 0
        self._map = 0
        self.times: list[tuple[float, float]] = []  # of each piece, per simulated second: update, step [s]
        self.used = 0.0
        self._piece = [0.0, 0.0]
        self._piece_began = 0.0
        self.samples: list[Sample] = []
        shape: Any = scene.bodies.make_shape()
        bodies = [EngineBody(shape=shape, state=state, friction=scene.bodies.friction) for state in scene.starts()]
        setup = Setup(
            heights=maps(0), resolution=scene.grid[1], bodies=bodies, dt=1.0 / configuration.rate, slide=scene.slide
        )
        self.engine = build(configuration.engine, setup, configuration.options)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._steps / self.configuration.rate

    def advance(self, until: float) -> None:
        """Step to ``until`` [s] with the scene's maps. Stop if that takes too much processor time."""
        engine, rate, scene = self.engine, self.configuration.rate, self._scene
        last = round(until * rate)
        before = engine.velocities()
        while self._steps < last:
            if self.used + sum(self._piece) > PATIENCE:
                self.note = f"stopped after {self.time:.2f} s: too slow"
                return
            number = math.floor(self._steps / rate * scene.map_rate + 1e-6)
            give = None if number == self._map else self._handing(self._maps(number))
            if self._steps == last - 1:
                before = engine.velocities()
            start = process_time()
            if give is not None:
                give()
                self._map = number
            middle = process_time()
            engine.step()
            end = process_time()
            # Another checkout runs in a process of its own, which measures itself.
            update, step = engine.taken() if isinstance(engine, Checkout) else (middle - start, end - middle)
            self._piece[0] += update
            self._piece[1] += step
            self._steps += 1
        after = engine.velocities()
        held = held_up(before[:, :3], after[:, :3], 1.0 / rate)
        self.samples.append(Sample(engine.positions(), engine.orientations(), held))

    def _handing(self, heights: Any) -> Callable[[], None]:
        """Return a function that transfers a map in the engine's own format, which is prepared before the
        measurement."""
        engine: Any = self.engine
        if self.configuration.engine == "mujoco":
            ready = engine.normalised(heights)
            return lambda: engine.write(ready)
        ready = heights if self.configuration.engine in ("smartmesh", "checkout") else np.array(heights, np.float64)
        return lambda: engine.set_ground(ready)

    def end_piece(self) -> None:
        """Notes the running time since the last call."""
        simulated = self.time - self._piece_began
        self.used += sum(self._piece)
        if simulated <= 0.0:
            return
        self.times.append((self._piece[0] / simulated, self._piece[1] / simulated))
        self._piece, self._piece_began = [0.0, 0.0], self.time


def run_scene(
    scene: Scene, chosen: list[Configuration], say: Callable[[str], None], pieces: int = PIECES
) -> dict[str, Result]:
    """Runs a scene in every configuration, taking turns piece by piece."""
    maps = Maps(scene)
    results: dict[str, Result] = {}
    runners: list[Runner] = []
    chosen = [configuration for configuration in chosen if scene.slide != (0.0, 0.0) or not configuration.for_sliding]
    for configuration in chosen:
        try:
            runners.append(Runner(scene, configuration, maps))
        except InputError as error:
            results[configuration.name] = Result(bodies=scene.bodies.count, note=str(error))
    instants = np.arange(1, round(scene.duration * scene.samples) + 1) / scene.samples
    truth = scene.make_ground()
    surfaces = {}
    for part, piece in enumerate(np.array_split(instants, min(pieces, len(instants)))):
        first = part % max(len(runners), 1)
        for index, runner in enumerate(runners[first:] + runners[:first]):
            if runner.note:
                continue
            say(f"{scene.name} {part + 1}/{pieces} {index + 1}/{len(runners)} {runner.configuration.name}")
            for instant in piece.tolist():
                runner.advance(instant)
            runner.end_piece()
        for instant in piece.tolist():
            surfaces[instant] = np.array(truth.heights(instant)) if scene.moves else truth.heights(instant)
        _measure(scene, surfaces, runners)
        maps.forget(math.floor(float(piece[-1]) * scene.map_rate) - 1)
        surfaces.clear()
    reference = reference_positions(scene)
    for runner in runners:
        results[runner.configuration.name] = _result(scene, runner, reference)
        runner.engine.close()
    return {configuration.name: results[configuration.name] for configuration in chosen}


def _measure(scene: Scene, surfaces: dict[float, Any], runners: list[Runner]) -> None:
    """Adds clearance and whether the centre is below the ground to the samples of the last piece."""
    shape = scene.bodies.make_shape()
    for runner in runners:
        fresh = [sample for sample in runner.samples if sample.clearance is None]
        for sample, (instant, heights) in zip(fresh, surfaces.items(), strict=False):
            surface = scene.surface(heights, instant)
            ground = surface.below(sample.positions)
            sample.clearance = clearances(surface, shape, sample.positions, sample.orientations)
            sample.clearance[np.isnan(ground)] = np.nan
            sample.below = sample.positions[:, 2] < ground


def _result(scene: Scene, runner: Runner, reference: FloatArray | None) -> Result:
    skip = round(scene.settle * scene.samples)
    measured = runner.samples[skip:]
    if not measured or not runner.times:
        return Result(bodies=scene.bodies.count, note=runner.note or "too slow to measure")
    clearance = np.array([sample.clearance for sample in measured])
    below = np.array([sample.below for sample in runner.samples])
    lost = np.logical_or.accumulate(below, axis=0)[skip:]
    found = penetration(clearance, lost, np.array([sample.held for sample in measured]))
    times = 1e6 / scene.bodies.count * np.array(runner.times)
    apart, second = None, round(HORIZON * scene.samples) - 1
    if reference is not None and len(runner.samples) > second:
        apart = deviation(runner.samples[second].positions, reference)
    update = float(np.median(times[:, 0]))
    return result_of(found, times.sum(axis=1), apart, update=update, ran=runner.time, note=runner.note)


def result_of(found: Penetration, times: FloatArray, apart: FloatArray | None, **more: Any) -> Result:
    """Return a result from its penetration, the processor time of each piece [us] (see `Result`), the deviation of each
    body [m], None = not measured, and the other fields."""
    low, middle, high = np.percentile(times, (25, 50, 75)).tolist()
    if apart is not None:
        more |= {"deviation": float(np.median(apart)), "most_deviation": float(apart.max())}
    return Result(cost=middle, spread=(low, high), **asdict(found), **more)
