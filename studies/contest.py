"""Runs one scene in many engines in turns, measures cost and accuracy of each, and compares them by the Pareto front.

A result is accurate if bodies are near the ground while something holds them up, and where they belong: penetration
alone would reward leaving the ground.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from time import process_time
from typing import Any, ClassVar, Literal

import numpy as np

from smartmesh_ros import InputError
from smartmesh_ros.scenes.moving import Scene as MovingGround
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import BoolArray, Penetration, held_up, penetration
from smartmesh_ros.tools.tune.figures import FLOOR
from studies.configurations import Configuration, Family
from studies.engines.engine import Links
from studies.pages import say

# Step rate of references [Hz], and instant of the comparison with them [s]. A later comparison is meaningless, because
# repeated contacts make the motion chaotic.
FINE_RATE = 8 * 240.0
HORIZON = 1.0


@dataclass(frozen=True, kw_only=True)
class Result(Penetration):
    """One configuration in one scene, with its penetration [m].

    ``cost`` [us]: processor time of update and step, per body and simulated second, median; ``spread``: its quartiles
    [us]; ``update``: the ground's share of it [us]; deviation from the reference after one second, median and largest
    over the bodies [m], NaN = none; ``note``: why it did not run, or not long; ``family`` of its configuration.
    """

    cost: float = math.nan
    spread: tuple[float, float] = (math.nan, math.nan)
    update: float = math.nan
    deviation: float = math.nan
    most_deviation: float = math.nan
    note: str = ""
    family: Family = "ours"


class Sample:
    """N bodies or robots at one instant: their ``links``, mask of supported ones (N,), and, once measured, clearance
    (N,) [m] and a mask of those that are below the ground (N,)."""

    def __init__(self, links: Links, held: BoolArray) -> None:
        self.links, self.held = links, held
        self.clearance = np.full(len(held), np.nan)
        self.below = np.zeros(len(held), bool)


class Contest(ABC):
    """A scene for many engines: how they enter, what they do in a step, and how samples of them are measured.

    The ``scene`` has a ``name``; a run of its ``duration`` [s] has ``samples`` measurements a second [Hz], after the
    first ``settle`` [s], on ground with maps at ``map_rate`` [Hz], 0 = one map. ``bodies``: their number. All engines
    take turns in the ``pieces`` of a run, timed from ``timed_from`` [s] on; the cost is the median over the pieces. An
    engine is stopped after ``patience`` [s] of processor time.
    """

    pieces: int
    timed_from: float = 0.0
    patience: ClassVar[float]

    def __init__(self, scene: Any, ground: MovingGround, bodies: int) -> None:
        self.scene, self.bodies = scene, bodies
        # The maps by their number, made once for all engines; those of a piece are kept.
        kept = lru_cache(math.ceil(scene.duration / self.pieces * scene.map_rate) + 16)
        self.maps = kept(lambda number: ground.heights(number / scene.map_rate if scene.map_rate else 0.0))

    @abstractmethod
    def enter(self, configuration: Configuration) -> Any:
        """Return the engine with the bodies at the start; raises `InputError` if it cannot run them."""

    def act(self, engine: Any, time: float) -> None:  # noqa: B027  nothing, but for joints that are held
        """What is done before each step, not timed."""

    @abstractmethod
    def measure(self, instant: float, runners: Sequence["Runner"]) -> None:
        """Fill in the samples at an instant [s]: who is below the ground, and after the settling the clearance."""

    @abstractmethod
    def reference(self) -> FloatArray | None:
        """Return the true places (N, 3) [m] after `HORIZON`; None = there is no reference."""

    def places_in(self, engine: Any, ground: MovingGround, maps: range) -> FloatArray:
        """Return the places (N, 3) [m] after `HORIZON` in an engine at `FINE_RATE` that gets maps of a ground before
        these steps, and end it."""
        with engine:
            for step in range(math.floor(HORIZON * FINE_RATE + 0.5)):
                time = step / FINE_RATE
                self.act(engine, time)
                if step in maps:
                    engine.set_ground(engine.ready(ground.heights(time)))
                engine.step()
            return np.asarray(engine.links().centres)


class Runner:
    """One configuration in a contest: steps and times it, and keeps samples by their instants [s]."""

    def __init__(self, contest: Contest, configuration: Configuration) -> None:
        self.configuration, self.note = configuration, ""
        self.samples: dict[float, Sample] = {}
        self.times: list[tuple[float, ...]] = []  # of each piece, per simulated second: update, step [s]
        self._contest = contest
        self._steps, self._map = 0, 0
        self._used = np.zeros(2)
        self.engine = contest.enter(configuration)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._steps / self.configuration.rate

    def run_piece(self, instants: Sequence[float]) -> None:
        """Advance over the instants of a piece, take a sample at each, and note what a simulated second took; stop if
        that takes too much processor time."""
        engine, contest, rate = self.engine, self._contest, self.configuration.rate
        began, used = self.time, self._used.copy()
        for instant in instants:
            before, last = engine.velocities(), round(instant * rate)
            while self._steps < last and not self.note:
                if self._used.sum() > contest.patience:
                    self.note = f"stopped after {self.time:.2f} s: too slow"
                    continue
                ready, number = None, math.floor(self.time * contest.scene.map_rate + 1e-6)
                if number != self._map:
                    ready, self._map = engine.ready(contest.maps(number)), number
                contest.act(engine, self.time)
                if self._steps == last - 1:
                    before = engine.velocities()
                start = process_time()
                if ready is not None:
                    engine.set_ground(ready)
                middle = process_time()
                engine.step()
                self._used += (middle - start, process_time() - middle)
                self._steps += 1
            if self.note:
                break
            held = held_up(before[:, :3], engine.velocities()[:, :3], 1.0 / rate)
            self.samples[instant] = Sample(engine.links(), held)
        if began >= contest.timed_from and self.time > began:
            self.times.append(tuple(((self._used - used) / (self.time - began)).tolist()))


def run(contest: Contest, chosen: Sequence[Configuration]) -> dict[str, Result]:
    """Run a scene in every configuration, taking turns piece by piece."""
    scene = contest.scene
    results: dict[str, Result] = {}
    runners: list[Runner] = []
    for configuration in chosen:
        try:
            runners.append(Runner(contest, configuration))
        except InputError as error:
            results[configuration.name] = Result(bodies=contest.bodies, note=str(error))
    instants = np.arange(1, round(scene.duration * scene.samples) + 1) / scene.samples
    for part, piece in enumerate(np.array_split(instants, min(contest.pieces, len(instants)))):
        first = part % max(len(runners), 1)
        for index, runner in enumerate(runners[first:] + runners[:first]):
            say(f"{scene.name} {part + 1}/{contest.pieces} {index + 1}/{len(runners)} {runner.configuration.name}")
            runner.run_piece(piece.tolist())
        for instant in piece.tolist():
            contest.measure(instant, [runner for runner in runners if instant in runner.samples])
    say(f"{scene.name}: reference")
    reference = contest.reference()
    for runner in runners:
        results[runner.configuration.name] = _result(contest, runner, reference)
        runner.engine.close()
    return {one.name: replace(results[one.name], family=one.family) for one in chosen}


def _result(contest: Contest, runner: Runner, reference: FloatArray | None) -> Result:
    measured = np.array(list(runner.samples)) > contest.scene.settle + 1e-9
    if not measured.any() or not runner.times:
        return Result(bodies=contest.bodies, note=runner.note or "too slow to measure")
    clearance, below, held = (
        np.array([getattr(sample, name) for sample in runner.samples.values()])
        for name in ("clearance", "below", "held")
    )
    lost = np.logical_or.accumulate(below, axis=0)
    found = penetration(clearance[measured], lost[measured], held[measured])
    times = 1e6 / contest.bodies * np.array(runner.times)
    low, middle, high = np.percentile(times.sum(axis=1), (25, 50, 75)).tolist()
    more: dict[str, Any] = {"update": float(np.median(times[:, 0]))}
    if reference is not None and HORIZON in runner.samples:
        apart = np.linalg.norm(runner.samples[HORIZON].links.centres - reference, axis=1)
        more |= {"deviation": float(np.median(apart)), "most_deviation": float(apart.max())}
    return Result(cost=middle, spread=(low, high), **asdict(found), **more, note=runner.note)


Measure = Literal["distance", "deviation"]


def distance_of(result: Result) -> float:
    """Return the distance from the ground [m] of bodies that something holds up: the larger of penetration and hover,
    99 %; infinite where bodies are lost or none was measured."""
    if result.lost or math.isnan(result.p99):
        return math.inf
    return max(result.p99, 0.0 if math.isnan(result.hover) else result.hover, FLOOR)


def deviation_of(result: Result) -> float:
    """Return the deviation from the reference after a second [m], median over the bodies; infinite where bodies are
    lost or it was not measured."""
    return math.inf if result.lost or math.isnan(result.deviation) else max(result.deviation, FLOOR)


MEASURES: dict[Measure, Callable[[Result], float]] = {"distance": distance_of, "deviation": deviation_of}


def measures_of(results: Mapping[str, Result]) -> tuple[Measure, ...]:
    """Return the measures of a scene; without a reference there is no deviation."""
    has_reference = any(not math.isnan(result.deviation) for result in results.values())
    return ("distance", "deviation") if has_reference else ("distance",)


def lasting(results: Mapping[str, Result]) -> dict[str, Result]:
    """Return the results that were measured and lost no bodies."""
    return {name: one for name, one in results.items() if one.cost > 0.0 and math.isfinite(distance_of(one))}


def pareto_front(results: Mapping[str, Result], measures: tuple[Measure, ...] | None = None) -> list[str]:
    """Return the names of the results that no other one beats in cost and all ``measures`` (None = the scene's), sorted
    by cost, without results that lost bodies."""
    chosen = measures_of(results) if measures is None else measures
    points = {name: (one.cost, *(MEASURES[by](one) for by in chosen)) for name, one in lasting(results).items()}

    def is_beaten(point: tuple[float, ...]) -> bool:
        return any(other != point and all(np.less_equal(other, point)) for other in points.values())

    return sorted((name for name in points if not is_beaten(points[name])), key=points.__getitem__)


def only_by(results: Mapping[str, Result]) -> dict[str, str]:
    """Return for each result on the front by which measure alone it is there: the one whose own front over cost and
    that measure has it; empty if both have, or there is one measure; "both together" if neither has."""
    measures = measures_of(results)
    fronts = {measure: pareto_front(results, (measure,)) for measure in measures}
    found: dict[str, str] = {}
    for name in pareto_front(results):
        by = [measure for measure in measures if name in fronts[measure]]
        found[name] = "" if len(by) == len(measures) else (by[0] if by else "both together")
    return found


def beyond_all(ours: Mapping[str, Result], rivals: Mapping[str, Result]) -> list[str]:
    """Return rivals that are both faster and more accurate than all of our results: in the distance from the ground
    and, if it was measured, in the deviation from the reference."""

    def beats(rival: Result, own: Result) -> bool:
        return rival.cost < own.cost and distance_of(rival) < distance_of(own) and not rival.deviation > own.deviation

    return [name for name, rival in lasting(rivals).items() if all(beats(rival, own) for own in ours.values())]


def cheapest_as_accurate(
    results: Mapping[str, Result], distance: float = math.inf, deviation: float = math.inf
) -> str | None:
    """Return the cheapest of the results that are at most so far from the ground and from the reference [m] and lost no
    bodies, None = there is none."""
    good = [
        (one.cost, name)
        for name, one in lasting(results).items()
        if distance_of(one) <= distance and deviation_of(one) <= deviation
    ]
    return min(good, default=(math.inf, None))[1]
