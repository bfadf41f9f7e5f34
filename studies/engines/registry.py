"""Engines by name. An engine whose package is not installed is left out, with a reason."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from smartmesh_ros.errors import InputError
from studies.engines.engine import Engine, Setup


class _Entry(NamedTuple):
    """Where an engine is: module and class."""

    module: str
    engine: str


_ENTRIES = {
    "smartmesh": _Entry("studies.engines.smartmesh", "SmartMesh"),
    "bullet_trimesh": _Entry("studies.engines.bullet", "BulletTrimesh"),
    "bullet_heightfield": _Entry("studies.engines.bullet", "BulletHeightfield"),
    "mujoco": _Entry("studies.engines.mujoco_hfield", "MujocoHfield"),
    "physx": _Entry("studies.engines.physx", "PhysxTrimesh"),
    "rapier": _Entry("studies.engines.rapier", "RapierHeightfield"),
    "checkout": _Entry("studies.engines.checkout", "Checkout"),
}
ENGINES = tuple(_ENTRIES)


@cache
def missing(name: str) -> str:
    """Return the reason why an engine cannot be used here, "" = none; raise `InputError` for an unknown name."""
    if name not in _ENTRIES:
        raise InputError("engine", f"there is no engine {name!r}; choose {', '.join(ENGINES)}")
    try:
        import_module(_ENTRIES[name].module)
    except (ImportError, OSError) as error:  # OSError: a library of the package's does not load
        return f"{type(error).__name__}: {error}"
    return ""


def build(name: str, setup: Setup, options: Any = None) -> Engine:
    """A scene in the engine of that name; raises `InputError` if it is unknown or not installed."""
    reason = missing(name)
    if reason:
        raise InputError("engine", f"engine {name!r} is not available ({reason}); install requirements/studies.txt")
    entry = _ENTRIES[name]
    engine: type[Engine] = getattr(import_module(entry.module), entry.engine)
    return engine(setup, options)
