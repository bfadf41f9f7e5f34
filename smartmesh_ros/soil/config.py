"""Soils: their parameters, those known by name from ``soils.yaml``, and what users give, checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, astuple, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError, is_number, naming, require
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.material import MOST_SOILS
from smartmesh_ros.yaml_text import parsed_yaml

KNOWN = Path(__file__).parent / "soils.yaml"
# Column of the table of soils, in the order of `SoilType`.
FRICTION = 4
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
    stiffness while unloaded soil recovers; larger values recover less, and from about 1e11 on bodies tremble and sink
    too deep, because the solver is not so exact. ``damping_R`` [Pa s/m]: pressure per sinking speed; larger values make
    bodies sink more slowly, to the same depth unless they are so slow that they fall asleep. Raises `InputError`.
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
            require(is_number(value) and low <= value <= high, "soil", field.name, value, f"{low:g} to {high:g}")
            object.__setattr__(self, field.name, float(value))  # to be saved
        if self.elastic_K <= self.Bekker_Kphi:
            raise InputError(
                "soil",
                f"elastic_K is {self.elastic_K:g} Pa/m and not above Bekker_Kphi, {self.Bekker_Kphi:g}; unloading must "
                "be stiffer than sinking, such as 2e8",
            )


@cache
def known_soils() -> dict[str, SoilType]:
    """Return the soils of ``soils.yaml`` by name. Raises `InputError` if there is no PyYAML."""
    soils = parsed_yaml(KNOWN.read_text())
    return {name: SoilType(**{key: soil[key] for key in soil if key != "source"}) for name, soil in soils.items()}


def soil_named(name: str) -> SoilType:
    """Return a soil by its name, or by a YAML mapping of its parameters: ``{Bekker_Kphi: 1.5e6, ...}``. Raises
    `InputError`."""
    if not name.lstrip().startswith("{"):
        known = known_soils()
        if name not in known:
            raise InputError("unknown_soil", f"there is no soil {name!r}; known: {', '.join(known)}")
        return known[name]
    with naming(f"soil {name!r}"):
        return _soil(parsed_yaml(name))


def _soil(values: dict[Any, Any]) -> SoilType:
    known = [field.name for field in fields(SoilType)]
    if unknown := [str(key) for key in values if key not in known]:
        raise InputError("soil", f"there is no parameter {unknown[0]!r}; the parameters are {', '.join(known)}")
    if missing := [field.name for field in fields(SoilType) if field.default is MISSING and field.name not in values]:
        raise InputError("soil", f"it lacks {', '.join(missing)}")
    return SoilType(**{key: _number(value) for key, value in values.items()})


def _number(value: Any) -> Any:
    """Return the number that a text is: YAML knows 1.5e+6, but takes 1.5e6 for a text."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def soils_from(soil: SoilType | str | Sequence[SoilType | str]) -> list[SoilType]:
    """Return one or several soils, which may be names; raises `InputError`."""
    chosen = list(soil) if isinstance(soil, Iterable) and not isinstance(soil, str) else [soil]
    if not all(isinstance(each, SoilType | str) for each in chosen):
        raise InputError("soil", f"{soil!r} is no soil; give a SoilType, its name, or a list of them")
    if not 1 <= len(chosen) <= MOST_SOILS:
        raise InputError("soil", f"{len(chosen)} soils; a map can have 1 to {MOST_SOILS}")
    return [soil_named(each) if isinstance(each, str) else each for each in chosen]


def soil_table(soils: list[SoilType]) -> FloatArray:
    """Return parameters of soils (S, 8) in the order of `SoilType`, friction as its tangent."""
    table = np.array([astuple(soil) for soil in soils], np.float64)
    table[:, FRICTION] = np.tan(np.radians(table[:, FRICTION]))
    return table
