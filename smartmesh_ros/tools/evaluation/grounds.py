"""Ground of the studies in addition to `smartmesh_ros.scenes.moving`, and the list of all ground by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.scenes import moving
from smartmesh_ros.scenes.moving import FloatGrid, Level, Scene, jacksboro_fault, resampled
from smartmesh_ros.terrain.grid import GridGeometry


class Rigid(Scene):
    """Static ground with heights ``surface`` (rows, columns) [m], or what gives them from x (columns,) and y (rows, 1)
    [m] from the middle of the map."""

    def __init__(self, geometry: GridGeometry, surface: Any) -> None:
        super().__init__(geometry)
        shape = (geometry.rows, geometry.columns)
        surface = surface(self.x, self.y) if callable(surface) else surface
        self.surface: FloatGrid = np.ascontiguousarray(np.broadcast_to(surface, shape), np.float32)

    def heights(self, time: float) -> FloatGrid:
        return self.surface


def heave(geometry: GridGeometry, height: float = 0.5, period: float = 4.0) -> Scene:
    """Return flat ground that rises by ``height`` [m] and falls again in every ``period`` [s]."""
    return Level(geometry, lambda time: 0.5 * height * (1.0 - math.cos(2.0 * math.pi * time / period)))


def lift(geometry: GridGeometry, speed: float = 2.0, duration: float = 1.0) -> Scene:
    """Return flat ground that rises at ``speed`` [m/s] (negative = falls) for ``duration`` [s] and stops."""
    return Level(geometry, lambda time: speed * min(max(time, 0.0), duration))


def drop(geometry: GridGeometry, acceleration: float = 20.0, depth: float = 2.0) -> Scene:
    """Return flat ground that falls from time zero with ``acceleration`` [m/s^2] down to ``depth`` [m], and stops."""
    return Level(geometry, lambda time: -min(0.5 * acceleration * max(time, 0.0) ** 2, depth))


def flat(geometry: GridGeometry) -> Scene:
    """Return level ground at z = 0."""
    return Rigid(geometry, 0.0)


def slope(geometry: GridGeometry, angle: float = 20.0) -> Scene:
    """Return ground that rises along x with a slope of ``angle`` [deg]."""
    return Rigid(geometry, lambda x, y: x * math.tan(math.radians(angle)))


def sinusoid(geometry: GridGeometry, amplitude: float = 0.05, wavelength: float = 2.0) -> Scene:
    """Return ripples along x and y of ``amplitude`` and ``wavelength`` [m]."""
    number = 2.0 * math.pi / wavelength
    return Rigid(geometry, lambda x, y: 0.5 * amplitude * (np.sin(number * x) + np.sin(number * y)))


def stairs(geometry: GridGeometry, rise: float = 0.1, tread: float = 1.0) -> Scene:
    """Return steps along x of height ``rise`` and length ``tread`` [m]; each riser is one cell wide."""
    return Rigid(geometry, lambda x, y: rise * np.floor(x / tread + 1e-6))


def noise(geometry: GridGeometry, deviation: float = 0.02, seed: int = 1) -> Scene:
    """Return independent normally distributed heights of standard ``deviation`` [m], the roughest possible map."""
    rng = np.random.default_rng(seed)
    return Rigid(geometry, rng.normal(0.0, deviation, (geometry.rows, geometry.columns)))


def elevation(geometry: GridGeometry, spacing: float = 10.0, relief: float = 100.0) -> Scene:
    """Return the middle of the elevation model of the Jacksboro fault, scaled to ``relief`` [m].

    The model's samples are ``spacing`` [m] apart; finer maps are interpolated bilinearly.
    """
    model = jacksboro_fault(relief)
    plain = Rigid(geometry, 0.0)
    heights = resampled(model, plain.y[:, 0] / spacing + model.shape[0] / 2, plain.x / spacing + model.shape[1] / 2)
    return Rigid(geometry, heights - heights.mean())


def waves(geometry: GridGeometry, amplitude: float = 0.3, number: float = 1.0, frequency: float = 4.0) -> Scene:
    """Return the report's inward waves."""
    return moving.InwardWaves(geometry, moving.Wave(amplitude, number, frequency))


GROUNDS: dict[str, Callable[..., Scene]] = {
    "flat": flat,
    "slope": slope,
    "sinusoid": sinusoid,
    "stairs": stairs,
    "noise": noise,
    "elevation": elevation,
    "waves": waves,
    "heave": heave,
    "crater": moving.Crater,
    "rut": moving.Rut,
    "lift": lift,
    "drop": drop,
}


def make_ground(geometry: GridGeometry, kind: str, **settings: Any) -> Scene:
    """Return ground by name; raises `InputError` for an unknown name or setting."""
    if kind not in GROUNDS:
        raise InputError("scene", f"there is no ground {kind!r}; choose {', '.join(GROUNDS)}")
    try:
        return GROUNDS[kind](geometry, **settings)
    except TypeError as error:
        raise InputError("scene", f"ground {kind!r} does not take {settings}: {error}") from None
