"""Maps of a rover that drives a loop and scans the ground: frames in order of time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.sensor.range_sensors import DepthCamera, Lidar, RangeSensor
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.tools.evaluation.distance import Surface
from studies.mapper.drift import DriftConfig, Estimator
from studies.mapper.elevation_mapper import ElevationMapper, MapperConfig
from studies.mapper.poses import LoopPath, Pose, on_ground
from studies.mapper.sensors import scan
from studies.mapper.truth import TruthConfig, true_ground

FloatGrid = NDArray[np.float32]
# How often real elevation mappers publish [Hz].
RATES = (5.0, 20.0)


@dataclass(frozen=True, kw_only=True)
class MappingConfig:
    """A drive and its maps.

    ``duration`` [s]: two laps, by default. ``rate`` [Hz]: of the maps. ``seed``: of all noise and drift; the same one
    makes the same maps. The first map comes one interval after the start.
    """

    duration: float = 60.0
    rate: float = 10.0
    seed: int = 0
    truth: TruthConfig = field(default_factory=TruthConfig)
    path: LoopPath = field(default_factory=LoopPath)
    sensors: tuple[RangeSensor, ...] = field(default_factory=lambda: (DepthCamera(), Lidar()))
    drift: DriftConfig = field(default_factory=DriftConfig)
    mapper: MapperConfig = field(default_factory=MapperConfig)

    def __post_init__(self) -> None:
        if not RATES[0] <= self.rate <= RATES[1]:
            raise InputError("parameter", f"maps at {self.rate} Hz; it must be {RATES[0]:g} to {RATES[1]:g} Hz")


class MapFrame(NamedTuple):
    """A map as it is published, and the truth.

    ``stamp`` [s] after the start. ``geometry``: where the cells lie in the map's frame, which without drift is the
    world. ``elevation`` (rows, columns) [m] and ``variance`` [m^2], NaN = never seen. ``truth`` [m]: the true height at
    the same places of the world, NaN outside the true ground. ``pose``, ``estimate``: where the rover is, and where it
    takes itself to be. ``closed``: whether a loop was closed since the frame before. Arrays are read-only.
    """

    stamp: float
    geometry: GridGeometry
    elevation: FloatGrid
    variance: FloatGrid
    truth: FloatGrid
    pose: Pose
    estimate: Pose
    closed: bool

    @property
    def error(self) -> FloatGrid:
        """How much too high the map is [m]; NaN where it is not known."""
        return np.asarray(self.elevation - self.truth)


def mapped_terrain(config: MappingConfig, ground: Surface | None = None) -> Iterator[MapFrame]:
    """The maps of a drive over ``ground``, by default the one that the configuration makes."""
    drive = Drive(config, ground or true_ground(config.truth))
    for number in range(1, math.floor(config.duration * config.rate + 1e-9) + 1):
        yield drive.to(number / config.rate)


class Drive:
    """The rover under way; `to` goes on to a time and returns the map there."""

    def __init__(self, config: MappingConfig, ground: Surface) -> None:
        self.config, self.ground = config, ground
        self.mapper = ElevationMapper(config.mapper)
        # One source of chance each: other noise does not make another drift.
        sensing, drifting = np.random.SeedSequence(config.seed).spawn(2)
        self.estimator = Estimator(config.drift, np.random.default_rng(drifting))
        self._rng = np.random.default_rng(sensing)
        self._time = 0.0

    def to(self, time: float) -> MapFrame:
        """Drives on to ``time`` [s], not before the last one."""
        since = self._time
        for moment, sensor, look in self._looks(since, time):
            self._wait_until(moment)
            pose = self.pose(moment)
            estimate = self.estimator.estimate(pose)
            self.mapper.follow(estimate)
            self.mapper.add(scan(sensor, self.ground, pose, look, self._rng), estimate)
        self._wait_until(time)
        closed = self.config.drift.closes(since, time)
        if closed:
            self._close_loop()
        self.mapper.follow(self.estimator.estimate(self.pose(time)))
        return self._frame(closed)

    def pose(self, time: float) -> Pose:
        """Where the rover truly is at a time [s]."""
        return on_ground(self.ground, *self.config.path.at(time))

    def _looks(self, since: float, until: float) -> list[tuple[float, RangeSensor, int]]:
        """(time, sensor, number) of the looks after ``since`` and not after ``until`` [s], in the order of time."""
        looks = []
        for sensor in self.config.sensors:
            first, last = (math.floor(time * sensor.rate + 1e-9) for time in (since, until))
            looks += [(number / sensor.rate, sensor, number) for number in range(first + 1, last + 1)]
        return sorted(looks, key=lambda look: look[0])

    def _wait_until(self, time: float) -> None:
        seconds = max(time - self._time, 0.0)
        self.estimator.wait(seconds)
        self.mapper.wait(seconds)
        self._time = time

    def _close_loop(self) -> None:
        pose = self.pose(self._time)
        before = self.estimator.estimate(pose)
        self.estimator.close_loop()
        self.mapper.correct(before, self.estimator.estimate(pose))

    def _frame(self, closed: bool) -> MapFrame:
        pose, geometry = self.pose(self._time), self.mapper.geometry
        layers = [self.mapper.heights, self.mapper.variances, true_heights(self.ground, geometry)]
        elevation, variance, truth = (_frozen(layer.astype(np.float32)) for layer in layers)
        return MapFrame(self._time, geometry, elevation, variance, truth, pose, self.estimator.estimate(pose), closed)


def true_heights(ground: Surface, geometry: GridGeometry) -> NDArray[np.float64]:
    """The ground (rows, columns) [m] under the samples of another grid; NaN outside it."""
    rows, columns = np.mgrid[: geometry.rows, : geometry.columns]
    places = np.zeros((geometry.size, 3))
    places[:, :2] = geometry.to_world(rows, columns).reshape(-1, 2)
    return ground.below(places).reshape(geometry.rows, geometry.columns)


def _frozen(layer: FloatGrid) -> FloatGrid:
    layer.setflags(write=False)
    return layer
