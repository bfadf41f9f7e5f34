"""Settings of a world."""

from __future__ import annotations

from dataclasses import dataclass, field

from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig
from smartmesh_ros.world.falling import FallConfig
from smartmesh_ros.world.guest_config import GuestConfig


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """Settings of a world: its physics, when bodies ``sleep``, bodies that fall off the ground
    (``falls``), and remote bodies (``guests``), which other nodes simulate."""

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    guests: GuestConfig = field(default_factory=GuestConfig)
    sleep: SleepConfig = field(default_factory=SleepConfig)
    falls: FallConfig = field(default_factory=FallConfig)
