"""Closed forms of plates and wheels on soil, and a measured wheel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smartmesh_ros import SoilType


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A rigid wheel: ``radius`` [m], ``width`` [m] and vertical ``load`` [N]."""

    radius: float
    width: float
    load: float


def modulus_of(soil: SoilType, width: float) -> float:
    """Return Bekker's modulus under a contact patch of a ``width`` b [m]."""
    return soil.Bekker_Kc / width + soil.Bekker_Kphi


def plate_sinkage(soil: SoilType, width: float, pressure: float) -> float:
    """Return the sinkage [m] of a plate under a ``pressure`` [Pa]."""
    return float((pressure / modulus_of(soil, width)) ** (1.0 / soil.Bekker_n))


def least(holds: Callable[[float], bool], low: float, high: float, times: int = 60) -> float:
    """Return the least value from ``low`` to ``high`` for which a condition ``holds``, by bisection."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def standing_sinkage(soil: SoilType, wheel: Wheel) -> float:
    """Return the sinkage [m] of a wheel that does not roll: the pressures under its rim, which are those of plates at
    the same depth, carry its load."""

    def bears(sinkage: float) -> bool:
        x = np.linspace(0.0, math.sqrt(2.0 * wheel.radius * sinkage - sinkage**2), 4001)
        depth = np.maximum(np.sqrt(wheel.radius**2 - x**2) - wheel.radius + sinkage, 0.0)
        pressure = modulus_of(soil, wheel.width) * depth**soil.Bekker_n
        return 2.0 * wheel.width * float(np.trapezoid(pressure, x)) >= wheel.load

    return least(bears, 0.0, wheel.radius)


class Measured(NamedTuple):
    """A run of the smooth wheel of robomechanics/3d-terramechanics: pull, load [N] and sinkage [m] at a slip."""

    slip: float
    pull: float
    load: float
    sinkage: float


SMOOTH = (
    Measured(-0.5, -17.2, 23.2, 23.7e-3), Measured(-0.2, -7.3, 23.7, 15.1e-3), Measured(0.0, -1.3, 24.6, 14.4e-3),
    Measured(0.23, 0.7, 24.6, 17.9e-3), Measured(0.5, 1.0, 25.3, 22.7e-3), Measured(0.75, 0.8, 24.0, 25.4e-3),
    Measured(0.9, 1.5, 25.7, 25.7e-3),
)  # fmt: skip
K10 = Wheel(radius=0.058, width=0.05, load=24.6)
