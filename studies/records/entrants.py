"""The engines of the records, and their options."""

from collections.abc import Mapping
from typing import Any

from smartmesh_ros import PhysicsConfig
from studies.chart import COLOURS
from studies.engines.engine import Engine, GroundSetup, build, missing

RATE = 240  # of physics [Hz]
# Engine, options and colour by the name in tables. MuJoCo has its own default contacts, and the stiffest that it takes.
# Bodies are awake all the time: those that sleep cost nothing anywhere.
ENTRANTS: Mapping[str, tuple[str, Mapping[str, Any], str]] = {
    "smartmesh_ros": ("smartmesh", {"physics": PhysicsConfig(sleep=False)}, COLOURS["ours"]),
    "PyBullet": ("bullet_heightfield", {}, COLOURS["whole map"]),
    "MuJoCo": ("mujoco", {"time_constant": 0.02}, "#8fbfe0"),
    "MuJoCo, stiff": ("mujoco", {}, COLOURS["MuJoCo"]),
    "PhysX": ("physx", {}, COLOURS["PhysX"]),
    "Rapier": ("rapier", {}, COLOURS["Rapier"]),
}
OURS = "smartmesh_ros"


def entrants() -> list[str]:
    """Return the names of the engines that are installed."""
    return [name for name, (engine, *_) in ENTRANTS.items() if not missing(engine)]


def enter(name: str, setup: GroundSetup) -> Engine:
    """Return a scene in an engine. The plane of our bodies is PyBullet's."""
    engine, options, _ = ENTRANTS["PyBullet" if setup.plane and name == OURS else name]
    found: Engine = build(engine, setup, **options)
    return found
