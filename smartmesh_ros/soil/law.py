"""The Soil Contact Model of one sample: Bekker's pressure, elastic unloading, Mohr-Coulomb and Janosi-Hanamoto shear.

Krenn and Hirzinger, *SCM - a soil contact model for multi-body system simulations*, 2009; Tasora and others, *A
deformable terrain model in multi-domain dynamics using elastoplastic constraints*, 2019.
"""

from __future__ import annotations

import math

from smartmesh_ros.compiled import compiled


@compiled
def pressure_at(
    sinkage: float, plastic: float, yielded: float, modulus: float, exponent: float, elastic: float
) -> float:
    """Return the pressure [Pa] of soil at a ``sinkage`` [m].

    ``plastic`` [m]: sinkage that remains without load. ``yielded`` [Pa]: highest pressure so far. Below it the soil is
    elastic; above it, Bekker's ``modulus`` x sinkage^``exponent`` limits the elastic pressure.
    """
    trial = elastic * (sinkage - plastic)
    if sinkage <= 0.0 or trial <= 0.0:
        return 0.0
    if trial <= yielded:
        return trial
    return min(trial, max(yielded, modulus * sinkage**exponent))


@compiled
def stiffness_at(sinkage: float, pressure: float, plastic: float, exponent: float, elastic: float) -> float:
    """Return the derivative of a ``pressure`` [Pa] of `pressure_at` by the sinkage [Pa/m]."""
    if pressure <= 0.0:
        return 0.0
    if pressure >= elastic * (sinkage - plastic):
        return elastic
    return min(exponent * pressure / sinkage, elastic)


@compiled
def plastic_after(
    sinkage: float, pressure: float, plastic: float, yielded: float, elastic: float
) -> tuple[float, float]:
    """Return the plastic sinkage [m] and the highest pressure [Pa] after a ``pressure`` at a ``sinkage``."""
    if pressure <= 0.0 or elastic * (sinkage - plastic) <= yielded:
        return plastic, yielded
    return max(plastic, sinkage - pressure / elastic), max(yielded, pressure)


@compiled
def shear_at(pressure: float, displacement: float, cohesion: float, tan_friction: float, shear: float) -> float:
    """Return the shear stress [Pa] after a shear ``displacement`` [m]; ``shear`` [m] is Janosi's K."""
    if pressure <= 0.0:
        return 0.0
    return (cohesion + pressure * tan_friction) * (1.0 - math.exp(-displacement / shear))
