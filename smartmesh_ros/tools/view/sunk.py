"""Ground in colours: by its depth below its first map, such as ruts in soil, and by its friction."""

from __future__ import annotations

from enum import Enum
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Height at which the colours are drawn above the ground [m], below patches.
LIFT = 0.003


class Band(Enum):
    """Entries of a legend: words, colour, and least value."""

    @property
    def words(self) -> str:
        """Text in the legend."""
        return str(self.value[0])

    @property
    def colour(self) -> tuple[int, int, int]:
        """Red, green and blue, 0 to 255."""
        red, green, blue = self.value[1]
        return red, green, blue

    @property
    def least(self) -> float:
        """Least value."""
        return float(self.value[2])


class Depth(Band):
    """Depths below the first map [m]."""

    SLIGHT = ("1 to 5 mm", (250, 226, 150), 0.001)
    SHALLOW = ("5 to 15 mm", (247, 176, 80), 0.005)
    DEEP = ("15 to 40 mm", (226, 106, 44), 0.015)
    DEEPEST = ("more than 40 mm", (158, 38, 34), 0.04)


class Grip(Band):
    """Coefficients of friction, by which those of bodies are multiplied. Ground with 1 keeps its colour."""

    ICE = ("friction below 0.3", (112, 176, 236), 0.0)
    SLIPPERY = ("0.3 to 0.7", (152, 196, 226), 0.3)
    FIRM = ("0.7 to 1", (182, 200, 206), 0.7)
    ROUGH = ("more than 1", (160, 112, 66), 1.0)


def triangles_by_band(
    values: NDArray[np.float64], triangles: NDArray[Any], bands: type[Band]
) -> dict[Band, NDArray[Any]]:
    """Return the triangles (n, 3) of each band, by the corner with the largest of the ``values`` (V,) of the vertices.
    Triangles with a NaN, or below the first band, are left out."""
    largest = np.nan_to_num(values[triangles].max(axis=1), nan=-np.inf)
    found = np.digitize(largest, [band.least for band in bands]) - 1
    return {band: triangles[found == number] for number, band in enumerate(bands)}


class Tint:
    """The parts of a height map that lie in one of some bands, in their colours, in a viser scene. ``stale``: what is
    drawn is no longer right."""

    def __init__(self, scene: Any, path: str, bands: type[Band]) -> None:
        self._scene, self._path, self._bands = scene, path, bands
        self._handles: dict[Band, Any] = {}
        self._due = 0.0
        self.stale = True

    @property
    def is_due(self) -> bool:
        """True if it is to be drawn again."""
        return self.stale and monotonic() >= self._due

    def show(
        self, vertices: NDArray[np.float32], values: NDArray[np.float64], triangles: NDArray[Any], period: float
    ) -> None:
        """Draw ``triangles`` (T, 3) of ``vertices`` (V, 3) [m] by their ``values`` (V,); due again after a ``period``
        [s]."""
        self.stale, self._due = False, monotonic() + period
        for band, chosen in triangles_by_band(values, triangles, self._bands).items():
            if not len(chosen):
                self._remove(band)
                continue
            used, places = np.unique(chosen, return_inverse=True)
            raised = vertices[used] + np.array([0.0, 0.0, LIFT], np.float32)
            self._handles[band] = self._scene.add_mesh_simple(
                f"{self._path}/{band.name}", raised, places.reshape(-1, 3), color=band.colour, side="front",
                cast_shadow=False,
            )  # fmt: skip

    def remove(self) -> None:
        """Remove all colours."""
        self.stale = True
        for band in self._bands:
            self._remove(band)

    def _remove(self, band: Band) -> None:
        if band in self._handles:
            self._handles.pop(band).remove()
