"""The search space: parameters and their values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from optuna import Trial

from smartmesh_ros.terrain.motion import MotionMode
from smartmesh_ros.tools.tune.start import DEFAULTS

# Ordered values (ladders) by parameter. They are round, and every rate is a multiple of the measurements' 30 Hz. The
# kinds are contacts from the map, and a collider of the whole map: the report's other kinds are slower and no more
# accurate, see docs/accuracy.md.
LADDERS: Mapping[str, tuple[Any, ...]] = {
    "physics.rate": (60.0, 90.0, 120.0, 150.0, 180.0, 240.0, 300.0, 360.0, 480.0, 600.0, 720.0, 960.0),
    "patch.rate": (15.0, 30.0, 60.0, 120.0, 240.0, 0.0),
    "patch.kind": ("auto", "whole_heightfield"),
    "terrain.motion": get_args(MotionMode),
    "physics.solver_residual": (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3),
    "physics.contact_erp": (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
}
CHOICES = ("patch.kind", "terrain.motion")


def defaults() -> dict[str, Any]:
    """Return the package's defaults of the searched parameters."""
    return {name: DEFAULTS[name] for name in LADDERS}


def changes(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the searched parameters whose values are not the defaults."""
    return {name: values[name] for name, default in defaults().items() if values[name] != default}


def draw(trial: Trial) -> dict[str, Any]:
    """Draw the values of a trial. A number is drawn as its index in the ladder, so that the sampler knows the order."""
    return {
        name: trial.suggest_categorical(name, ladder)
        if name in CHOICES
        else ladder[trial.suggest_int(name, 0, len(ladder) - 1)]
        for name, ladder in LADDERS.items()
    }


def parameters_of(values: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return values as `draw` draws them, numbers rounded to their ladders; None if a choice is not searched."""
    if any(values[name] not in LADDERS[name] for name in CHOICES):
        return None
    return {
        name: values[name]
        if name in CHOICES
        else min(range(len(ladder)), key=lambda index: abs(ladder[index] - float(values[name])))
        for name, ladder in LADDERS.items()
    }
