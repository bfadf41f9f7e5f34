"""The grid: settings to measure, each in a process of its own."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from itertools import product, repeat
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.parameters.specifications import SPECS, settings_from
from smartmesh_ros.tools.tune.case import Case
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.measuring import measure

# Values by parameter: what buys speed for accuracy. Each rate is a multiple of that of the measurements, 30 Hz.
GRID: Mapping[str, tuple[float, ...]] = {
    "physics.rate": (60.0, 90.0, 120.0, 180.0, 240.0, 360.0, 480.0, 960.0),
    "physics.solver_residual": (1e-9, 1e-7, 1e-6, 1e-5, 1e-4),
}
KNOWN: Mapping[str, float] = {spec.name: spec.default for spec in SPECS if spec.name in GRID}
# The run that bodies are compared with: an eighth of the default's step.
SMALL_STEPS = {**KNOWN, "physics.rate": 8.0 * KNOWN["physics.rate"]}


def settings_to_try(given: Mapping[str, Any]) -> list[dict[str, float]]:
    """Return the defaults, the other points of the grid, and the user's settings if they are none of these."""
    grid = [dict(zip(GRID, values, strict=True)) for values in product(*GRID.values())]
    found = [{**KNOWN}, *(values for values in grid if values != KNOWN)]
    own = own_settings(given)
    return found if own in found else [*found, own]


def own_settings(given: Mapping[str, Any]) -> dict[str, float]:
    """Return the user's settings, from all parameters that were given. Raises `InputError` if the node would refuse
    them."""
    physics = settings_from(given).world.physics
    return {name: getattr(physics, name.removeprefix("physics.")) for name in KNOWN}


def measure_all(case: Case, jobs: int, show: Callable[[float], None]) -> list[Figures]:
    """Return the figures of all settings, measured in ``jobs`` processes at a time, and ``show`` which share is done
    after each. Raises `InputError` if the node would refuse the case, or nothing can be measured."""
    tried = settings_to_try(case.parameters)
    found: list[tuple[Figures, dict[str, Vector]]] = []
    # A process for each setting: what one has allocated and cached does not change the cost of another. They are forks
    # of a process that has imported everything.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([measure.__module__])
    with ProcessPoolExecutor(jobs, context, max_tasks_per_child=1) as pool:
        try:
            for measured in pool.map(measure, repeat(case), [*tried, SMALL_STEPS]):
                found.append(measured)
                if math.isinf(found[0][0].error):
                    raise InputError(
                        "bodies", "nothing can be measured here: no simulated body stayed over the ground; the "
                        "parameter file's bodies.spawn or robot.description must put bodies over the maps"
                    )  # fmt: skip
                show(len(found) / (len(tried) + 1))
        except BrokenProcessPool:
            raise InputError("jobs", "a process ended before its setting was measured; see its output above") from None
        except KeyboardInterrupt:
            for child in multiprocessing.active_children():
                child.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
    _, reference = found.pop()
    points = []
    for values, (figures, positions) in zip(tried, found, strict=True):
        apart = [math.dist(positions[name], end) for name, end in reference.items() if name in positions]
        points.append(replace(figures, values=values, deviation=float(np.median(apart)) if apart else math.nan))
    return points
