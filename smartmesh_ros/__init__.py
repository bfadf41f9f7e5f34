"""Bodies stand on terrain that moves.

The public API for PyBullet users without ROS: a `HeightMap` (or a `Terrain` of tiles) deforms, `Ground` lets the bodies
of an existing PyBullet world stand on it, and `World` is a whole world of its own.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from smartmesh_ros.errors import InputError
    from smartmesh_ros.ground.config import PhysicsConfig
    from smartmesh_ros.ground.ground import Ground
    from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Sphere
    from smartmesh_ros.ground.state import BodyState
    from smartmesh_ros.soil.config import SoilType
    from smartmesh_ros.soil.soil import Soil
    from smartmesh_ros.terrain.deck import Deck
    from smartmesh_ros.terrain.grid import GridGeometry
    from smartmesh_ros.terrain.height_scan import HeightScan
    from smartmesh_ros.terrain.heightmap import HeightMap
    from smartmesh_ros.terrain.material import Material
    from smartmesh_ros.terrain.motion import MotionConfig
    from smartmesh_ros.terrain.terrain import Terrain
    from smartmesh_ros.world.base import Base, BaseOdometry
    from smartmesh_ros.world.base_config import BaseConfig
    from smartmesh_ros.world.driving import Carrier
    from smartmesh_ros.world.height_scanner import HeightScanner
    from smartmesh_ros.world.imu import Imu, ImuConfig, ImuReading
    from smartmesh_ros.world.joints import JointCommand
    from smartmesh_ros.world.snapshot import Snapshot
    from smartmesh_ros.world.world import World, WorldConfig

_MODULES = {
    "errors": ("InputError",),
    "ground.config": ("PhysicsConfig",),
    "ground.ground": ("Ground",),
    "world.base": ("Base", "BaseOdometry"),
    "world.base_config": ("BaseConfig",),
    "world.driving": ("Carrier",),
    "world.height_scanner": ("HeightScanner",),
    "world.imu": ("Imu", "ImuConfig", "ImuReading"),
    "world.joints": ("JointCommand",),
    "world.snapshot": ("Snapshot",),
    "ground.shapes": ("Box", "Capsule", "Cylinder", "Sphere"),
    "ground.state": ("BodyState",),
    "world.world": ("World", "WorldConfig"),
    "soil.config": ("SoilType",),
    "soil.soil": ("Soil",),
    "terrain.deck": ("Deck",),
    "terrain.grid": ("GridGeometry",),
    "terrain.height_scan": ("HeightScan",),
    "terrain.heightmap": ("HeightMap",),
    "terrain.material": ("Material",),
    "terrain.motion": ("MotionConfig",),
    "terrain.terrain": ("Terrain",),
}
_MODULE_OF = {name: f"{__name__}.{module}" for module, names in _MODULES.items() for name in names}

__all__ = [
    "Base",
    "BaseConfig",
    "BaseOdometry",
    "BodyState",
    "Box",
    "Capsule",
    "Carrier",
    "Cylinder",
    "Deck",
    "GridGeometry",
    "Ground",
    "HeightMap",
    "HeightScan",
    "HeightScanner",
    "Imu",
    "ImuConfig",
    "ImuReading",
    "InputError",
    "JointCommand",
    "Material",
    "MotionConfig",
    "PhysicsConfig",
    "Snapshot",
    "Soil",
    "SoilType",
    "Sphere",
    "Terrain",
    "World",
    "WorldConfig",
]


def __dir__() -> list[str]:
    return [*__all__, *globals()]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use, so that the terrain and patch rooms load without PyBullet."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)
