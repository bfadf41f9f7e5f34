"""Configurations of the charts: our settings, the report's methods, and other engines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from smartmesh_ros import PhysicsConfig
from smartmesh_ros.node.parameters.specifications import settings_from
from smartmesh_ros.tools.replay.parameters import PRESETS, preset_values
from studies.engines.engine import GroundSetup, build, missing
from studies.report.config import ReportConfig

Family = Literal["ours", "ours, less", "report", "whole map", "MuJoCo", "PhysX", "Rapier"]

RATE = 240.0


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """One point of the chart: an ``engine`` by its name with ``options``, stepped at ``rate`` [Hz]. ``quick``: part of
    the quick run. ``for_sliding``: part of scenes only whose ground slides."""

    name: str
    family: Family
    engine: str
    options: Mapping[str, Any] = field(default_factory=dict)
    rate: float = RATE
    quick: bool = False
    for_sliding: bool = False

    def build(self, setup: GroundSetup) -> Any:
        """Return a scene in the engine; raises `InputError` if it cannot run it."""
        return build(self.engine, setup, **self.options)


def _ours(
    name: str, family: Family = "ours", physics: float = RATE, quick: bool = False, **report: Any
) -> Configuration:
    """One of ours: the rate of its ``physics`` [Hz], and settings of the report's colliders, if any."""
    options = {"report": ReportConfig(**report)} if report else {}
    return Configuration(name=name, family=family, engine="smartmesh", options=options, rate=physics, quick=quick)


OURS = (
    _ours("defaults", quick=True),
    _ours("defaults, 60 Hz", physics=60.0),
    _ours("defaults, 120 Hz", physics=120.0),
    _ours("defaults, 480 Hz", physics=480.0, quick=True),
    _ours("defaults, 960 Hz", physics=960.0),
    _ours("heightfield", "ours, less", kind="heightfield", quick=True),
    _ours("heightfield, 120 Hz", "ours, less", physics=120.0, kind="heightfield"),
    _ours("3 x 3", "ours, less", kind="heightfield", rings=1),
    _ours("9 x 9", "ours, less", kind="heightfield", rings=4),
)
# The report's method: patches rebuilt in every step, without later additions.
BARE: dict[str, Any] = {"carry_velocity": False, "rate": 0.0}
REPORT = (
    _ours("rebuilt trimesh", "report", kind="trimesh", quick=True, **BARE),
    _ours("convex hull", "report", kind="hull", **BARE),
    _ours("prisms", "report", kind="prisms", **BARE),
)


def _presets(engine: str) -> list[Configuration]:
    """Return the parameter files that come with the package."""
    found = {name: settings_from(preset_values(name)).world.physics for name in PRESETS}
    return [
        Configuration(
            name=f"preset {name}", family="ours", engine=engine, options={"physics": physics}, rate=physics.rate
        )
        for name, physics in found.items()
    ]


def _at_rates(words: str, family: Family, engine: str, rates: Sequence[float], **more: Any) -> list[Configuration]:
    """Return an engine, named by ``words``, at several ``rates`` [Hz]; the quick run has that of `RATE`."""
    return [
        Configuration(
            name=f"{words}, {rate:.0f} Hz", family=family, engine=engine, rate=rate, quick=rate == RATE, **more
        )
        for rate in rates
    ]


# MuJoCo's and Rapier's own defaults; unless these are given both are tuned.
_MUJOCO, _RAPIER = {"time_constant": 0.02}, {"stiff": False}


def _chosen(found: Sequence[Configuration], *, quick: bool = False) -> list[Configuration]:
    """Return the configurations whose engines are installed, or those of them that are part of the quick run."""
    return [one for one in found if (one.quick or not quick) and not missing(one.engine)]


def rivals() -> list[Configuration]:
    """Whole colliders and other engines, as far as they are installed."""
    return _chosen([
        Configuration(name="whole trimesh", family="whole map", engine="bullet_trimesh", quick=True),
        Configuration(name="whole heightfield", family="whole map", engine="bullet_heightfield"),
        *_at_rates("MuJoCo", "MuJoCo", "mujoco", [RATE], options=_MUJOCO),
        *_at_rates("MuJoCo tuned", "MuJoCo", "mujoco", (120.0, 240.0, 480.0, 960.0, 1920.0, 7680.0)),
        *_at_rates("MuJoCo tuned, surfacevel", "MuJoCo", "mujoco", (240.0, 480.0, 960.0), for_sliding=True,
                   options={"surface_velocity": True}),
        *_at_rates("PhysX", "PhysX", "physx", (240.0, 480.0)),
        *_at_rates("Rapier", "Rapier", "rapier", [RATE], options=_RAPIER),
        *_at_rates("Rapier stiff", "Rapier", "rapier", (240.0, 480.0, 960.0)),
    ])  # fmt: skip


def configurations(*, quick: bool) -> list[Configuration]:
    """All points of the chart of bodies, or those of the quick run."""
    return _chosen([*OURS, *_presets("smartmesh"), *REPORT, *rivals()], quick=quick)


def robot_configurations(*, quick: bool) -> list[Configuration]:
    """All points of the charts of robots, or those of the quick run."""
    ours, mujoco, physx = "smartmesh robots", "mujoco robots", "physx robots"
    awake = {"physics": PhysicsConfig(sleep=False)}
    whole = {"report": ReportConfig(kind="whole_heightfield"), **awake}
    return _chosen([
        Configuration(name="defaults", family="ours", engine=ours, quick=True),
        Configuration(name="defaults, never asleep", family="ours", engine=ours, options=awake, quick=True),
        *_presets(ours),
        Configuration(name="whole heightfield", family="whole map", engine=ours, options=whole, quick=True),
        Configuration(name="MuJoCo, 240 Hz", family="MuJoCo", engine=mujoco, options=_MUJOCO),
        *_at_rates("MuJoCo tuned", "MuJoCo", mujoco, (240.0, 480.0, 960.0)),
        *_at_rates("PhysX", "PhysX", physx, (RATE, 480.0)),
        Configuration(name="PhysX, 240 Hz, sleeps", family="PhysX", engine=physx, options={"sleeps": True}),
    ], quick=quick)  # fmt: skip
