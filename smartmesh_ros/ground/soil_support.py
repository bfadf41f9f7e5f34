"""What soil under a ground is to its bodies."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from smartmesh_ros.terrain.heightmap import HeightMap


class SteppedSoil(Protocol):
    """Soil that takes part in the steps of a ground, such as `ContactSoil`."""

    core: Any  # of the C++ core

    @property
    def map(self) -> HeightMap:
        """The tile that gives way."""

    def show(self) -> int:
        """Write what was pressed into the map; returns the number of changed samples."""


class SoilSupport(NamedTuple):
    """How the soil bears a body or link: the deepest ``sinkage`` [m], pressed ``area`` [m^2], and the force that its
    pressures have ``carried`` [N], without damping."""

    sinkage: float
    area: float
    carried: float
