"""Engines by name. An engine whose package is not installed is left out, with a reason."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from smartmesh_ros.errors import InputError
from studies.engines.engine import Engine, Setup

# Module and class of each engine.
_ENTRIES = {
    "smartmesh": ("studies.engines.smartmesh", "SmartMesh"),
    "bullet_trimesh": ("studies.engines.bullet", "BulletTrimesh"),
    "bullet_heightfield": ("studies.engines.bullet", "BulletHeightfield"),
    "mujoco": ("studies.engines.mujoco_hfield", "MujocoHfield"),
    "physx": ("studies.engines.physx", "PhysxTrimesh"),
    "rapier": ("studies.engines.rapier", "RapierHeightfield"),
    "checkout": ("studies.engines.checkout", "Checkout"),
}
ENGINES = tuple(_ENTRIES)


@cache
def missing(name: str) -> str:
    """Return the reason why an engine cannot be used here, "" = none; raise `InputError` for an unknown name."""
    if name not in _ENTRIES:
        raise InputError("engine", f"there is no engine {name!r}; choose {', '.join(ENGINES)}")
    try:
        import_module(_ENTRIES[name][0])
    except (ImportError, OSError) as error:  # OSError: a library of the package's does not load
        return f"{type(error).__name__}: {error}"
    return ""


def build(name: str, setup: Setup, options: Any = None) -> Engine:
    """A scene in the engine of that name; raises `InputError` if it is unknown or not installed."""
    reason = missing(name)
    if reason:
        raise InputError("engine", f"engine {name!r} is not available ({reason}); install requirements/studies.txt")
    module, kind = _ENTRIES[name]
    engine: type[Engine] = getattr(import_module(module), kind)
    return engine(setup, options)
