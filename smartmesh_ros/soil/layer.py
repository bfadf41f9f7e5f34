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
# Fields of a sample in `SoilLayer`, side by side in memory, because bodies need all fields of few samples.
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


class SoilLayer(NamedTuple):
    """Soil of a height map; all (rows, columns) unless noted. The core writes the fields.

    ``samples``: records of ``LAYER_SAMPLE``, whose fields follow. ``level`` [m]: height of the soil as it was never
    pressed, without the map's z. ``target`` [m]: height at the end of the current update. ``plastic`` [m]: sinkage that
    remains without load. ``yielded`` [Pa]: highest pressure so far. ``pressure`` [Pa]: of the last update. ``shear_x``,
    ``shear_y`` [m]: shear displacement of the loaded soil, along columns and rows. ``known`` [m]: height in the map as
    of the last update; another height there is new ground. ``touched``: 1 = the other fields hold values. ``moves``:
    1 = the last update gave the sample a velocity. ``pressed``: number of the last update in which a body pressed the
    sample. ``kinds``: rows of ``soils``. ``soils`` (S, 8): parameters of the soils in the order of `SoilType`, friction
    as its tangent.
    """

    samples: NDArray[np.void]
    level: FloatArray
    target: FloatArray
    plastic: Floats
    yielded: Floats
    pressure: Floats
    shear_x: Floats
    shear_y: Floats
    known: Floats
    touched: Bytes
    moves: Bytes
    pressed: NDArray[np.int32]
    kinds: Bytes
    soils: FloatArray


def soil_table(soils: list[SoilType]) -> FloatArray:
    """Return parameters of soils (S, 8) in the order of `SoilType`, friction as its tangent."""
    table = np.array([astuple(soil) for soil in soils], np.float64)
    table[:, FRICTION] = np.tan(np.radians(table[:, FRICTION]))
    return table


def untouched_layer(shape: tuple[int, int], soils: list[SoilType], kinds: Bytes) -> SoilLayer:
    """Return soil that nobody has touched; memory is allocated when it is written."""
    samples = np.zeros(shape, LAYER_SAMPLE)
    fields = {name: samples[name] for name in LAYER_SAMPLE.fields or {}}
    return SoilLayer(samples=samples, **fields, kinds=kinds, soils=soil_table(soils))
