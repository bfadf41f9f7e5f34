"""Configurations of the study of robots: our settings, one collider of the whole map, and other engines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from studies.configurations import RATE, Family
from studies.engines.registry import missing
from studies.presets import read_presets
from studies.robots.bullet_robots import WorldOptions, WorldRobots
from studies.robots.engine import RobotEngine, RobotSetup


@dataclass(frozen=True, kw_only=True)
class RobotConfiguration:
    """One point of the charts: how an engine with its options is built, stepped at ``rate`` [Hz]. ``quick``: part of
    the quick run."""

    name: str
    family: Family
    build: Callable[[RobotSetup], RobotEngine]
    rate: float = RATE
    quick: bool = False


def world(
    name: str, patch: PatchConfig, physics: PhysicsConfig, family: Family = "ours", **settings: Any
) -> RobotConfiguration:
    """Return one of ours, or another collider in our world."""
    options = WorldOptions(patch=patch, physics=physics)
    return RobotConfiguration(
        name=name, family=family, build=lambda setup: WorldRobots(setup, options), rate=physics.rate, **settings
    )


def configurations(*, quick: bool) -> list[RobotConfiguration]:
    """Return all points of the charts, or those of the quick run."""
    awake = PhysicsConfig(sleep=False)
    found = [
        world("defaults", PatchConfig(), PhysicsConfig(), quick=True),
        world("defaults, never asleep", PatchConfig(), awake, quick=True),
        *(world(f"preset {preset.name}", preset.patch, preset.physics) for preset in read_presets()),
        world("whole heightfield", PatchConfig(kind="whole_heightfield"), awake, "whole map", quick=True),
        *_mujoco(),
        *_physx(),
    ]
    return [one for one in found if one.quick or not quick]


def _mujoco() -> list[RobotConfiguration]:
    if missing("mujoco"):
        return []
    from studies.robots.mujoco_robots import MujocoRobotOptions, MujocoRobots

    default = MujocoRobotOptions(time_constant=0.02)  # MuJoCo's own
    return [
        RobotConfiguration(name="MuJoCo, 240 Hz", family="MuJoCo", build=lambda setup: MujocoRobots(setup, default)),
        *(
            RobotConfiguration(
                name=f"MuJoCo tuned, {rate:.0f} Hz", family="MuJoCo", build=MujocoRobots, rate=rate, quick=rate == RATE
            )
            for rate in (240.0, 480.0, 960.0)
        ),
    ]


def _physx() -> list[RobotConfiguration]:
    if missing("physx"):
        return []
    from studies.robots.physx_robots import PhysxRobotOptions, PhysxRobots

    sleeps = PhysxRobotOptions(sleeps=True)
    return [
        RobotConfiguration(name="PhysX, 240 Hz", family="PhysX", build=PhysxRobots, quick=True),
        RobotConfiguration(
            name="PhysX, 240 Hz, sleeps", family="PhysX", build=lambda setup: PhysxRobots(setup, sleeps)
        ),
        RobotConfiguration(name="PhysX, 480 Hz", family="PhysX", build=PhysxRobots, rate=480.0),
    ]
