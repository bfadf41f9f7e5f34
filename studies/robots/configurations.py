"""Configurations of the study of robots: our settings, one collider of the whole map, and other engines."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from studies.configurations import RATE, Configuration, Family
from studies.engines.registry import missing
from studies.presets import read_presets
from studies.robots.bullet_robots import WorldOptions, WorldRobots
from studies.robots.engine import RobotEngine, RobotSetup


def world(
    name: str, patch: PatchConfig, physics: PhysicsConfig, family: Family = "ours", *, quick: bool = False
) -> Configuration:
    """Return one of ours, or another collider in our world."""
    options = WorldOptions(patch=patch, physics=physics)
    return Configuration(name=name, family=family, engine="smartmesh", options=options, rate=physics.rate, quick=quick)


def configurations(*, quick: bool) -> list[Configuration]:
    """Return all points of the charts, or those of the quick run."""
    awake = PhysicsConfig(sleep=False)
    found = [
        world("defaults", PatchConfig(), PhysicsConfig(), quick=True),
        world("defaults, never asleep", PatchConfig(), awake, quick=True),
        *(world(f"preset {preset.name}", preset.patch, preset.physics) for preset in read_presets()),
        world("whole heightfield", PatchConfig(kind="whole_heightfield"), awake, "whole map", quick=True),
    ]
    if not missing("mujoco"):
        from studies.robots.mujoco_robots import MujocoRobotOptions

        default = MujocoRobotOptions(time_constant=0.02)  # MuJoCo's own
        found.append(Configuration(name="MuJoCo, 240 Hz", family="MuJoCo", engine="mujoco", options=default))
        found += [
            Configuration(
                name=f"MuJoCo tuned, {rate:.0f} Hz", family="MuJoCo", engine="mujoco", rate=rate, quick=rate == RATE
            )
            for rate in (240.0, 480.0, 960.0)
        ]
    if not missing("physx"):
        from studies.robots.physx_robots import PhysxRobotOptions

        sleeps = PhysxRobotOptions(sleeps=True)
        found += [
            Configuration(name="PhysX, 240 Hz", family="PhysX", engine="physx", quick=True),
            Configuration(name="PhysX, 240 Hz, sleeps", family="PhysX", engine="physx", options=sleeps),
            Configuration(name="PhysX, 480 Hz", family="PhysX", engine="physx", rate=480.0),
        ]
    return [one for one in found if one.quick or not quick]


def build(configuration: Configuration, setup: RobotSetup) -> RobotEngine:
    """Return the robots of a setup in the engine of a configuration."""
    options: Any = configuration.options
    if configuration.engine == "mujoco":
        from studies.robots.mujoco_robots import MujocoRobots

        return MujocoRobots(setup, options)
    if configuration.engine == "physx":
        from studies.robots.physx_robots import PhysxRobots

        return PhysxRobots(setup, options)
    return WorldRobots(setup, options)
