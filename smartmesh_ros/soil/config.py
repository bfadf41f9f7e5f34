"""Soils and settings of the soil model."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from smartmesh_ros.errors import InputError

# Smallest and largest value of each parameter of a soil, in its unit. Wide enough for snow and for rock.
_LIMITS = {
    "Bekker_Kphi": (1.0, 1e12),
    "Bekker_Kc": (0.0, 1e12),
    "Bekker_n": (0.1, 3.0),
    "Mohr_cohesion": (0.0, 1e9),
    "Mohr_friction": (0.0, 89.0),
    "Janosi_shear": (1e-5, 10.0),
    "elastic_K": (1.0, 1e13),
    "damping_R": (0.0, 1e9),
}


@dataclass(frozen=True, kw_only=True)
class SoilType:
    """Parameters of a soil, under Chrono's names and in Chrono's units (``SCMTerrain::SetSoilParameters``).

    ``Bekker_Kphi`` [N/m^(n+2)], ``Bekker_Kc`` [N/m^(n+1)], ``Bekker_n`` [-]: pressure against sinkage, p = (Kc / b +
    Kphi) z^n; raising the moduli makes the soil harder. ``Mohr_cohesion`` [Pa], ``Mohr_friction`` [degrees]: shear
    strength. ``Janosi_shear`` [m]: shear displacement at which 63 % of the strength is reached. ``elastic_K`` [Pa/m]:
    stiffness while unloaded soil recovers; larger values recover less. ``damping_R`` [Pa s/m]: pressure per sinking
    speed; larger values make bodies sink more slowly, to the same depth. Raises `InputError`.
    """

    Bekker_Kphi: float
    Bekker_Kc: float
    Bekker_n: float
    Mohr_cohesion: float
    Mohr_friction: float
    Janosi_shear: float
    elastic_K: float = 2e8  # noqa: N815  # Chrono's name
    damping_R: float = 3e4  # noqa: N815

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            low, high = _LIMITS[field.name]
            if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                raise InputError("soil", f"{field.name} is {value!r}; it must be {low:g} to {high:g}")
        if self.elastic_K <= self.Bekker_Kphi:
            raise InputError(
                "soil",
                f"elastic_K is {self.elastic_K:g} Pa/m and not above Bekker_Kphi, {self.Bekker_Kphi:g}; unloading must "
                "be stiffer than sinking, such as 2e8",
            )


@dataclass(frozen=True, kw_only=True)
class SoilConfig:
    """Settings of the soil model.

    ``flow``: share of the displaced volume that moves to the rim, 0 to 1; the rest is compacted. ``rim`` [samples]:
    width of that rim. ``repose`` [degrees]: angle above which disturbed ground slides down. ``slides``: rounds of
    sliding in an update, 0 = none; slopes of several samples need several. ``load_time`` [s]: time constant of the
    filter on contact forces; raising it makes impacts milder and bodies sink later. ``lean_time`` [s]: the same for the
    place of these forces, which decides how a body leans into the soil; noisy contacts need more. ``fastest`` [m/s]:
    limit of the sinking speed. ``still`` [m/s]: ground that moves more slowly stays where it is, so that updates end;
    raising it leaves more of the last sinkage out. ``flow_speed`` [m/s]: limit of the speed of samples that rise or
    have no load; raising it lets the rim throw bodies. ``carried_speed`` [m/s]: samples that sink
    faster jump, without a velocity: a collider has one velocity and spin for all its samples, and rut walls that
    collapse would spin it. ``grip``: set the friction of bodies by the shear law, if the source of the bodies can.
    """

    flow: float = 0.0
    rim: int = 2
    repose: float = 32.0
    slides: int = 0
    load_time: float = 0.06
    lean_time: float = 1.0
    fastest: float = 2.0
    still: float = 1e-3
    flow_speed: float = 0.1
    carried_speed: float = 0.3
    grip: bool = True

    def __post_init__(self) -> None:
        limits = {
            "flow": (0.0, 1.0), "rim": (1, 20), "repose": (1.0, 89.0), "slides": (0, 100), "load_time": (0.0, 10.0),
            "lean_time": (0.0, 100.0),
            "fastest": (1e-3, 100.0), "still": (0.0, 0.1),
            "flow_speed": (1e-3, 100.0), "carried_speed": (0.0, 100.0),
        }  # fmt: skip
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise InputError("soil", f"{name} is {value}; it must be {low:g} to {high:g}")
