"""Parameters of soils."""

from __future__ import annotations

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
