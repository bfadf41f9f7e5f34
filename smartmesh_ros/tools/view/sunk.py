"""Ground that lies below its first map, such as ruts in soil: coloured by its depth."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Height at which the colours are drawn above the ground [m], below patches.
LIFT = 0.003


class Depth(Enum):
    """Entries of the legend: words, colour, and least depth [m]."""

    SLIGHT = ("1 to 5 mm", (250, 226, 150), 0.001)
    SHALLOW = ("5 to 15 mm", (247, 176, 80), 0.005)
    DEEP = ("15 to 40 mm", (226, 106, 44), 0.015)
    DEEPEST = ("more than 40 mm", (158, 38, 34), 0.04)

    @property
    def words(self) -> str:
        """Text in the legend."""
        return self.value[0]

    @property
    def colour(self) -> tuple[int, int, int]:
        """Red, green and blue, 0 to 255."""
        return self.value[1]

    @property
    def least(self) -> float:
        """Least depth [m]."""
        return self.value[2]


def triangles_by_depth(sunk: NDArray[np.float64], triangles: NDArray[Any]) -> dict[Depth, NDArray[Any]]:
    """Return the triangles (n, 3) of each depth, by the deepest corner; ``sunk`` (V,) [m] is the depth of each vertex,
    NaN = hole. Triangles with a corner in a hole are left out."""
    deepest = np.nan_to_num(sunk[triangles].max(axis=1))
    bands = np.digitize(deepest, [depth.least for depth in Depth]) - 1
    return {depth: triangles[bands == band] for band, depth in enumerate(Depth)}


class SunkGround:
    """The colours of a height map in a viser scene."""

    def __init__(self, scene: Any, path: str) -> None:
        self._scene, self._path = scene, path
        self._handles: dict[Depth, Any] = {}

    def show(self, vertices: NDArray[np.float32], sunk: NDArray[np.float64], triangles: NDArray[Any]) -> None:
        """Draw ``triangles`` (T, 3) of ``vertices`` (V, 3) [m] that are ``sunk`` (V,) [m]."""
        for depth, chosen in triangles_by_depth(sunk, triangles).items():
            if not len(chosen):
                self._remove(depth)
                continue
            used, places = np.unique(chosen, return_inverse=True)
            raised = vertices[used] + np.array([0.0, 0.0, LIFT], np.float32)
            self._handles[depth] = self._scene.add_mesh_simple(
                f"{self._path}/{depth.name}", raised, places.reshape(-1, 3), color=depth.colour, side="front",
                cast_shadow=False,
            )  # fmt: skip

    def remove(self) -> None:
        """Remove all colours."""
        for depth in Depth:
            self._remove(depth)

    def _remove(self, depth: Depth) -> None:
        if depth in self._handles:
            self._handles.pop(depth).remove()
