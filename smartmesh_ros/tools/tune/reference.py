"""The reference run: an eighth of the default step, and patches refreshed in every step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from smartmesh_ros.ground.state import Vector
from smartmesh_ros.tools.evaluation.reference import FINE_RATE
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.replay import Replay
from smartmesh_ros.tools.tune.start import settings_of

FINEST: Mapping[str, Any] = {
    "physics.rate": FINE_RATE,
    "patch.kind": "auto",
    "patch.rate": 0.0,
    "terrain.motion": "extrapolate",
    "terrain.min_interval": 0.0,  # maps come with every step, and each gives a velocity of its own
}


def finest_positions(case: Case, start: Mapping[str, Any], horizon: float) -> dict[str, Vector]:
    """Return the positions of the simulated bodies after ``horizon`` [s], by name [m]."""
    case.fresh()
    fed = -math.inf
    with Replay(settings_of({**start, **FINEST}), case.bodies()) as replay:
        world = replay.world
        for step in range(round(horizon * FINE_RATE)):
            events, fed = case.events(fed, world.time), world.time
            replay.step(events)
            if step % 100 == 0:
                case.forget(fed)
        return {name: world.state(name).position for name, body in world.bodies.items() if not body.tracked}
