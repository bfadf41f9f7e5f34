"""State of the soil under each sample of a height map."""

from __future__ import annotations

from dataclasses import astuple
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.soil.config import SoilType
from smartmesh_ros.terrain.grid import FloatArray

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]

# Column of the table of soils, in the order of `SoilType`.
FRICTION = 4
# State of the soil under a sample, which the core writes; side by side in memory, because bodies need all fields of few
# samples. ``level`` [m]: height of the soil as it was never pressed, without the map's z. ``target`` [m]: height at the
# end of the current update. ``plastic`` [m]: sinkage that remains without load. ``yielded`` [Pa]: highest pressure so
# far. ``pressure`` [Pa]: of the last update. ``shear_x``, ``shear_y`` [m]: shear displacement of the loaded soil, along
# columns and rows. ``known`` [m]: height in the map as of the last update; another height there is new ground.
# ``touched``: 1 = the other fields hold values. ``moves``: 1 = the last update gave the sample a velocity. ``pressed``:
# number of the last update in which a body pressed the sample.
LAYER_SAMPLE = np.dtype(
    [
        ("level", np.float64), ("target", np.float64), ("plastic", np.float32), ("yielded", np.float32),
        ("pressure", np.float32), ("shear_x", np.float32), ("shear_y", np.float32), ("known", np.float32),
        ("touched", np.uint8), ("moves", np.uint8), ("pressed", np.int32),
    ],
    align=True,
)  # fmt: skip


class Region(NamedTuple):
    """A changed rectangle of the map: its first ``row`` and ``column``, new ``heights`` (h, w) [m] relative to the
    map's z, and ``velocities`` (h, w) [m/s]."""

    row: int
    column: int
    heights: Floats
    velocities: Floats


def soil_table(soils: list[SoilType]) -> FloatArray:
    """Return parameters of soils (S, 8) in the order of `SoilType`, friction as its tangent."""
    table = np.array([astuple(soil) for soil in soils], np.float64)
    table[:, FRICTION] = np.tan(np.radians(table[:, FRICTION]))
    return table
