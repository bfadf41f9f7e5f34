"""Closed forms of plates and wheels on soil, a measured wheel, and wheels by Wong and Reece's integrals (1967), as
references of bodies in PyBullet.

The soil of the integrals is elastic, so that it also carries a wheel behind its lowest point, and a second wheel may
roll in the rut of a first.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
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


# Runs of the smooth wheel of robomechanics/3d-terramechanics: slip, pull, load [N] and sinkage [m].
SMOOTH = (
    (-0.5, -17.2, 23.2, 23.7e-3), (-0.2, -7.3, 23.7, 15.1e-3), (0.0, -1.3, 24.6, 14.4e-3), (0.23, 0.7, 24.6, 17.9e-3),
    (0.5, 1.0, 25.3, 22.7e-3), (0.75, 0.8, 24.0, 25.4e-3), (0.9, 1.5, 25.7, 25.7e-3),
)  # fmt: skip
K10 = Wheel(radius=0.058, width=0.05, load=24.6)


class WheelForces(NamedTuple):
    """``sinkage`` [m] of a driven wheel, and its horizontal ``pull`` [N] along its motion."""

    sinkage: float
    pull: float


def slip_sinkage(slip: float) -> float:
    """Return by which factor slip deepens a plate's sinkage: Lyasko, Slip sinkage effect in soil-vehicle mechanics,
    Journal of Terramechanics 47, 2010."""
    limited = min(max(slip, 0.0), 1.0)
    return (1.0 + limited) / (1.0 - 0.5 * limited)


def wheel_forces(
    soil: SoilType, wheel: Wheel, slip: float, *, rut: float = 0.0, speed: float = 0.0, sinks_by_slip: bool = True
) -> WheelForces:
    """Return the forces of a wheel that carries its load at a ``slip``, in a ``rut`` [m], at a ``speed`` [m/s], which
    adds the soil's damping."""
    modulus, radius = modulus_of(soil, wheel.width), wheel.radius
    if sinks_by_slip:
        modulus *= slip_sinkage(slip) ** -soil.Bekker_n

    def forces(sinkage: float) -> tuple[float, float]:
        deepest = modulus * sinkage**soil.Bekker_n
        entry = math.acos(1.0 - (sinkage - rut) / radius)
        leave = math.acos(max(1.0 - deepest / soil.elastic_K / radius, 0.0))
        angle = np.concatenate((np.linspace(-leave, 0.0, 501)[:-1], np.linspace(0.0, entry, 2001)))
        depth = np.maximum(sinkage - radius * (1.0 - np.cos(angle)), 0.0)
        pressure = np.where(angle < 0.0, deepest - soil.elastic_K * (sinkage - depth), modulus * depth**soil.Bekker_n)
        total = np.maximum(pressure + soil.damping_R * speed * np.tan(angle), 0.0)
        moved = radius * ((entry - angle) - (1.0 - slip) * (math.sin(entry) - np.sin(angle)))
        strength = np.where(
            total > 0.0, soil.Mohr_cohesion + pressure * math.tan(math.radians(soil.Mohr_friction)), 0.0
        )
        stress = np.sign(moved) * strength * -np.expm1(-np.abs(moved) / soil.Janosi_shear)
        arc = radius * wheel.width
        down = np.trapezoid(total * np.cos(angle) + stress * np.sin(angle), angle)
        along = np.trapezoid(stress * np.cos(angle) - total * np.sin(angle), angle)
        return float(arc * down), float(arc * along)

    sinkage = least(lambda sinkage: forces(sinkage)[0] >= wheel.load, rut, 0.99 * radius, 50)
    return WheelForces(sinkage, forces(sinkage)[1])


def free_slip(soil: SoilType, wheel: Wheel, *, speed: float = 0.0) -> float:
    """Return the slip of a cart on four such wheels, the rear ones in the ruts of the front ones: there their pulls add
    up to nothing. NaN if it gets stuck."""

    def pull(slip: float) -> float:
        front = wheel_forces(soil, wheel, slip, speed=speed)
        rear = wheel_forces(soil, wheel, slip, rut=front.sinkage, speed=speed)
        return front.pull + rear.pull

    tried = [0.02 * k for k in range(-10, 48)]
    found = next((slip for slip in tried if pull(slip) > 0.0), math.nan)
    return least(lambda slip: pull(slip) >= 0.0, found - 0.02, found, 12)


def undamped(soil: SoilType) -> SoilType:
    """Return a soil without damping, as the integrals of slow wheels know it."""
    return replace(soil, damping_R=0.0)
