"""The search space: parameters and their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from optuna import Trial

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.tune.start import DEFAULTS

Value = float | str


@dataclass(frozen=True, kw_only=True)
class Space:
    """Ordered lists (ladders) of values. The values are round, and every rate is a multiple of the measurements' 30 Hz.

    The kinds are contacts from the map, and a collider of the whole map. The report's other kinds are slower and no
    more accurate, see docs/accuracy.md.
    """

    rate: tuple[float, ...] = (60.0, 90.0, 120.0, 150.0, 180.0, 240.0, 300.0, 360.0, 480.0, 600.0, 720.0, 960.0)
    patch_rate: tuple[float, ...] = (15.0, 30.0, 60.0, 120.0, 240.0, 0.0)
    kind: tuple[str, ...] = ("auto", "whole_heightfield")
    motion: tuple[str, ...] = ("hold", "extrapolate", "interpolate")
    solver_residual: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
    contact_erp: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)

    @property
    def ladders(self) -> Mapping[str, tuple[Value, ...]]:
        """Ladders by parameter."""
        return {
            "physics.rate": self.rate,
            "patch.rate": self.patch_rate,
            "patch.kind": self.kind,
            "terrain.motion": self.motion,
            "physics.solver_residual": self.solver_residual,
            "physics.contact_erp": self.contact_erp,
        }


SPACE = Space()
SEARCHED = tuple(SPACE.ladders)
_CHOICES = frozenset({"patch.kind", "terrain.motion"})


def defaults() -> dict[str, Any]:
    """Return the package's defaults of the searched parameters."""
    return {name: DEFAULTS[name] for name in SEARCHED}


def ask(trial: Trial) -> dict[str, Any]:
    """Draw the values of a trial. A number is drawn as its index in the ladder, so that the sampler knows the order."""
    found: dict[str, Any] = {}
    for name, ladder in SPACE.ladders.items():
        if name in _CHOICES:
            found[name] = trial.suggest_categorical(name, ladder)
        else:
            found[name] = ladder[trial.suggest_int(name, 0, len(ladder) - 1)]
    return found


def values_of(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a trial's stored ``parameters``."""
    return {name: value if name in _CHOICES else SPACE.ladders[name][int(value)] for name, value in parameters.items()}


def parameters_of(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the stored form of values, each rounded to its ladder; raise `InputError` for a choice that is not
    searched."""
    found: dict[str, Any] = {}
    for name, ladder in SPACE.ladders.items():
        value = values[name]
        if name in _CHOICES:
            if value not in ladder:
                raise InputError(
                    "parameter", f"{name} {value!r} is not searched; it may be {', '.join(map(str, ladder))}"
                )
            found[name] = value
        else:
            found[name] = min(range(len(ladder)), key=lambda index: abs(float(ladder[index]) - float(value)))
    return found
