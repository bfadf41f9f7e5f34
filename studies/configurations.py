"""Configurations of the accuracy study: our settings, the report's methods, and other engines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from smartmesh_ros.patches.config import PatchConfig
from studies.engines.registry import missing
from studies.engines.smartmesh import SmartMeshOptions
from studies.presets import read_presets

Family = Literal["ours", "ours, less", "report", "whole map", "MuJoCo", "PhysX", "Rapier"]

RATE = 240.0


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """One point of the chart: an ``engine`` of the registry with ``options``, stepped at ``rate`` [Hz]. ``quick``: part
    of the quick run. ``for_sliding``: part of scenes only whose ground slides."""

    name: str
    family: Family
    engine: str
    options: Any = None
    rate: float = RATE
    quick: bool = False
    for_sliding: bool = False


def _patch(name: str, family: Family, physics: float = RATE, quick: bool = False, **settings: Any) -> Configuration:
    """One of ours: the rate of its ``physics`` [Hz], and settings of its patches."""
    options = SmartMeshOptions(patch=PatchConfig(**settings))
    return Configuration(name=name, family=family, engine="smartmesh", options=options, rate=physics, quick=quick)


OURS = (
    _patch("defaults", "ours", quick=True),
    _patch("defaults, 60 Hz", "ours", physics=60.0),
    _patch("defaults, 120 Hz", "ours", physics=120.0),
    _patch("defaults, 480 Hz", "ours", physics=480.0, quick=True),
    _patch("defaults, 960 Hz", "ours", physics=960.0),
    _patch("patches at every step", "ours", rate=0.0),
    _patch("patches at 30 Hz", "ours", rate=30.0),
    _patch("heightfield", "ours, less", kind="heightfield", quick=True),
    _patch("heightfield, 120 Hz", "ours, less", physics=120.0, kind="heightfield"),
    _patch("3 x 3", "ours, less", kind="heightfield", rings=1),
    _patch("9 x 9", "ours, less", kind="heightfield", rings=4),
    _patch("no velocity", "ours, less", carry_velocity=False, quick=True),
)
# The report's method: patches rebuilt in every step, without later additions.
BARE: dict[str, Any] = {"carry_velocity": False, "rate": 0.0}
REPORT = (
    _patch("rebuilt trimesh", "report", kind="trimesh", quick=True, **BARE),
    _patch("convex hull", "report", kind="hull", **BARE),
    _patch("prisms", "report", kind="prisms", **BARE),
)


def presets() -> list[Configuration]:
    """The parameter files that come with the package."""
    return [
        Configuration(
            name=f"preset {preset.name}", family="ours", engine="smartmesh", rate=preset.physics.rate,
            options=SmartMeshOptions(patch=preset.patch, physics=preset.physics),
        )
        for preset in read_presets()
    ]  # fmt: skip


def rivals() -> list[Configuration]:
    """Whole colliders and other engines, as far as they are installed."""
    found = [
        Configuration(name="whole trimesh", family="whole map", engine="bullet_trimesh", quick=True),
        Configuration(name="whole heightfield", family="whole map", engine="bullet_heightfield"),
    ]
    if not missing("mujoco"):
        from studies.engines.mujoco_hfield import MujocoOptions

        default = MujocoOptions(time_constant=0.02)  # MuJoCo's own
        found.append(
            Configuration(name="MuJoCo, 240 Hz", family="MuJoCo", engine="mujoco", options=default, quick=True)
        )
        found += [
            Configuration(
                name=f"MuJoCo tuned, {rate:.0f} Hz", family="MuJoCo", engine="mujoco", rate=rate, quick=rate == RATE
            )
            for rate in (120.0, 240.0, 480.0, 960.0, 1920.0, 7680.0)
        ]
        found += [
            Configuration(
                name=f"MuJoCo tuned, surfacevel, {rate:.0f} Hz", family="MuJoCo", engine="mujoco", rate=rate,
                options=MujocoOptions(surface_velocity=True), quick=rate == RATE, for_sliding=True,
            )
            for rate in (240.0, 480.0, 960.0)
        ]  # fmt: skip
    if not missing("physx"):
        found += [
            Configuration(name=f"PhysX, {rate:.0f} Hz", family="PhysX", engine="physx", rate=rate, quick=rate == RATE)
            for rate in (240.0, 480.0)
        ]
    if not missing("rapier"):
        from studies.engines.rapier import RapierOptions

        soft = RapierOptions(stiff=False)  # Rapier's own
        found.append(Configuration(name="Rapier, 240 Hz", family="Rapier", engine="rapier", options=soft, quick=True))
        found += [
            Configuration(
                name=f"Rapier stiff, {rate:.0f} Hz", family="Rapier", engine="rapier", rate=rate, quick=rate == RATE
            )
            for rate in (240.0, 480.0, 960.0)
        ]  # fmt: skip
    return found


def configurations(quick: bool) -> list[Configuration]:
    """All points of the chart, or those of the quick run."""
    return [one for one in (*OURS, *presets(), *REPORT, *rivals()) if one.quick or not quick]
