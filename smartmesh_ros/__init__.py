"""Bodies stand on terrain that moves.

The public API for PyBullet users without ROS: a `HeightMap` (or a `Terrain` of tiles) deforms, `Ground` lets the bodies
of an existing PyBullet world stand on it, and `World` is a whole world of its own.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from smartmesh_ros.errors import InputError as InputError
    from smartmesh_ros.ground.config import PhysicsConfig as PhysicsConfig
    from smartmesh_ros.ground.config import SleepConfig as SleepConfig
    from smartmesh_ros.ground.ground import Ground as Ground
    from smartmesh_ros.ground.shapes import Box as Box
    from smartmesh_ros.ground.shapes import Capsule as Capsule
    from smartmesh_ros.ground.shapes import Cylinder as Cylinder
    from smartmesh_ros.ground.shapes import Sphere as Sphere
    from smartmesh_ros.ground.state import BodyState as BodyState
    from smartmesh_ros.soil.config import SoilType as SoilType
    from smartmesh_ros.soil.soil import Soil as Soil
    from smartmesh_ros.terrain.deck import Deck as Deck
    from smartmesh_ros.terrain.grid import GridGeometry as GridGeometry
    from smartmesh_ros.terrain.height_scan import HeightScan as HeightScan
    from smartmesh_ros.terrain.heightmap import HeightMap as HeightMap
    from smartmesh_ros.terrain.material import Material as Material
    from smartmesh_ros.terrain.motion import MotionConfig as MotionConfig
    from smartmesh_ros.terrain.terrain import Terrain as Terrain
    from smartmesh_ros.terrain.trimesh import TriangleMesh as TriangleMesh
    from smartmesh_ros.world.base import Base as Base
    from smartmesh_ros.world.base import BaseOdometry as BaseOdometry
    from smartmesh_ros.world.base_config import BaseConfig as BaseConfig
    from smartmesh_ros.world.driving import Carrier as Carrier
    from smartmesh_ros.world.height_scanner import HeightScanner as HeightScanner
    from smartmesh_ros.world.imu import Imu as Imu
    from smartmesh_ros.world.imu import ImuConfig as ImuConfig
    from smartmesh_ros.world.imu import ImuReading as ImuReading
    from smartmesh_ros.world.joints import JointCommand as JointCommand
    from smartmesh_ros.world.settings import FallConfig as FallConfig
    from smartmesh_ros.world.snapshot import Snapshot as Snapshot
    from smartmesh_ros.world.world import World as World
    from smartmesh_ros.world.world import WorldConfig as WorldConfig

# The modules of the public names.
_MODULES = {
    "errors": ("InputError",),
    "ground.config": ("PhysicsConfig", "SleepConfig"),
    "ground.ground": ("Ground",),
    "world.base": ("Base", "BaseOdometry"),
    "world.base_config": ("BaseConfig",),
    "world.driving": ("Carrier",),
    "world.height_scanner": ("HeightScanner",),
    "world.imu": ("Imu", "ImuConfig", "ImuReading"),
    "world.joints": ("JointCommand",),
    "world.settings": ("FallConfig",),
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
    "terrain.trimesh": ("TriangleMesh",),
}
_MODULE_OF = {name: f"{__name__}.{module}" for module, names in _MODULES.items() for name in names}

__all__ = list(_MODULE_OF)


def __dir__() -> list[str]:
    return [*__all__, *globals()]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use, so that the terrain and patch rooms load without PyBullet."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)
