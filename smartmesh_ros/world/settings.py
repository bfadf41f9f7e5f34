"""Settings of a world."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from smartmesh_ros.errors import as_float, require, require_not_negative
from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig
from smartmesh_ros.ground.limits import FARTHEST_BODY


@dataclass(frozen=True, kw_only=True)
class FallConfig:
    """``depth`` [m]: a body this far below the ground that it left is lost. ``period`` [s]: simulated time between
    checks; shorter ones tell the place where a body left the ground more exactly. ``most``: bodies that one line
    names."""

    depth: float = 100.0
    period: float = 0.1
    most: int = 5

    def __post_init__(self) -> None:
        good = 0.0 < as_float(self.depth) <= FARTHEST_BODY
        require(good, "parameter", "lost depth", self.depth, f"above 0, to {FARTHEST_BODY:g} m")
        require_not_negative(self, "falls")


@dataclass(frozen=True, kw_only=True)
class GuestConfig:
    """When remote bodies are added, how they follow their owner's states, and when they are removed."""

    # Distance to an own body, surface to surface, below which a remote body is added [m]. A row of touching balls
    # transmits an impact over this distance.
    margin: float = 1.0
    # Remote bodies that can come within the margin in this time, at their relative speed, are added as well [s]. Must
    # exceed the delay of states.
    horizon: float = 0.2
    # Distance at which a remote body is removed [margins]. Above 1, so that none is added and removed in every step.
    stay: float = 1.5
    # Age at which a received state is used [steps], because two worlds detect the same contact up to this many steps
    # apart.
    steps_apart: int = 2
    # Time constant with which a body in lasting contact converges to its owner's state [s]. The delay of states is used
    # if it is longer, because a faster pull would oscillate.
    settle: float = 0.03
    # Longest extrapolation of a state by its velocity [s].
    max_extrapolation: float = 0.2
    # Gap between bounding spheres below which contacts are queried [m]; the range of PyBullet's contact points.
    touching: float = 0.02
    # Share by which the estimated delay decays towards a shorter measured one at each state.
    forget: float = 0.05
    # A state's time is rounded to a step of this world, so that both worlds detect an impact at the same depth. Filter
    # gain of the estimated phase between the owner's steps and this world's, at each state.
    drift: float = 0.02
    # Phase beyond which rounding changes to the next step [steps]. Between 0.5, where rounding would alternate, and 1.
    slip: float = 0.7

    def __post_init__(self) -> None:
        good = 0.0 < as_float(self.margin) < math.inf
        require(good, "parameter", "the margin of guests", self.margin, "finite and greater than zero [m]")
        require_not_negative(self, "guests")


@dataclass(frozen=True, kw_only=True)
class WorldConfig:
    """Settings of a world: its physics, when bodies ``sleep``, bodies that fall off the ground
    (``falls``), and remote bodies (``guests``), which other nodes simulate."""

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    guests: GuestConfig = field(default_factory=GuestConfig)
    sleep: SleepConfig = field(default_factory=SleepConfig)
    falls: FallConfig = field(default_factory=FallConfig)

    def __post_init__(self) -> None:
        for each in fields(self):
            value: Any = getattr(self, each.name)
            kind: Any = each.default_factory
            require(isinstance(value, kind), "parameter", f"{each.name} of a world", value, f"{kind.__name__}(...)")
