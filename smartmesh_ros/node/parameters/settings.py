"""The settings of ``terrain_collider``, as its parameters give them. The core's configs hold the core's defaults."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.io.urdf import UrdfRules
from smartmesh_ros.node.parameters.entries import BodySource, ScanEntry
from smartmesh_ros.node.running import ExecutorKind
from smartmesh_ros.node.timing.pacing import DeadlinePolicy
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.world import WorldConfig

# Longest name of a body, tile or frame [characters].
LONGEST_NAME = 256
Durability = Literal["volatile", "transient_local"]
Reliability = Literal["reliable", "best_effort"]
# Meaning of a change of height between maps; *auto*: a correction if sensors or mappers provide the terrain.
TerrainChanges = Literal["auto", "motion", "correction"]


@dataclass(frozen=True, kw_only=True)
class PublishRates:
    """Rate of each output while it has subscribers [Hz]; 0 = never."""

    patches: float = 30.0
    collider_patches: float = 30.0
    body_states: float = 60.0
    contacts: float = 30.0
    timing: float = 1.0
    clock: float = 0.0
    joint_states: float = 60.0
    odometry: float = 60.0
    contact_wrenches: float = 60.0
    tf: float = 0.0

    @property
    def pressed_ground(self) -> float:
        """Prints are published with the patches that stand in them."""
        return self.patches


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """The robot of the parameters ``robot.*``. ``description``: URDF text or the path of a URDF file; empty = the robot
    on ``~/robot_description``, if any. ``xy`` [m], ``yaw`` [rad]: start pose of the base. ``above`` [m]: start height
    of the base's centre above the ground.
    """

    description: str = ""
    name: str = "robot"
    xy: tuple[float, float] = (0.0, 0.0)
    above: float = 0.5
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if len(self.xy) != 2:
            raise InputError("parameter", f"robot.xy is {list(self.xy)}; it must be two numbers [m]")
        if not self.name or "/" in self.name:
            raise InputError("parameter", f"robot.name is {self.name!r}; it must not be empty and have no '/'")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The values of all parameters, as the node uses them."""

    world: WorldConfig = field(default_factory=WorldConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    publish: PublishRates = field(default_factory=PublishRates)
    frame_id: str = ""
    max_samples: int = 16_384**2
    durability: Durability = "volatile"
    reliability: Reliability = "reliable"
    input: str = "heightmap"
    file: str = ""
    soil: str = ""
    most_tiles: int = 1000
    most_bodies: int = 10_000
    longest_urdf: int = UrdfRules.longest
    urdf_folders: tuple[str, ...] = ()
    raster: RasterConfig = field(default_factory=RasterConfig)
    robot: RobotConfig = field(default_factory=RobotConfig)
    simulation_interfaces: bool = False
    poses: tuple[BodySource, ...] = ()
    odometry: tuple[BodySource, ...] = ()
    frames: tuple[BodySource, ...] = ()
    peers: tuple[str, ...] = ()
    height_scans: tuple[ScanEntry, ...] = ()
    output_durability: Durability = "volatile"
    incremental: bool = False
    marker_namespace: str = "patches"
    robot_prefix: bool = False
    body_timeout: float = 1.0
    default_radius: float = 0.25
    max_velocity: float = 10.0
    spawn: tuple[str, ...] = ()
    deadline: DeadlinePolicy = "catch_up"
    executor: ExecutorKind = "events"

    def __post_init__(self) -> None:
        if not self.soil:
            return
        soil_named(self.soil)
        if self.world.patch.kind != "auto":
            raise InputError("parameter", "soil.type needs contacts from the map: set patch.kind to auto")
        if self.motion.corrects:
            raise InputError("parameter", "soil.type needs maps that are exact: set terrain.changes to motion")
