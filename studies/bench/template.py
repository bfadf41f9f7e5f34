"""The constant layout of a grid patch: the cache of the report's Chapter 3, one template for every vertex of a map."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray


@dataclass(frozen=True, eq=False)
class PatchTemplate:
    """Layout of a patch of ``size`` x ``size`` samples, K = size * size, around its nearest vertex.

    ``rows``, ``columns``: offsets of the samples from the centre (K,), row by row, in units of the stride.
    ``triangles``: corners of its triangles (T, 3), counter-clockwise from above.
    """

    rings: int
    size: int
    rows: IntArray
    columns: IntArray
    triangles: NDArray[np.int32]
    _indices: dict[int, IntArray] = field(default_factory=dict, repr=False)

    def indices(self, columns: int) -> IntArray:
        """Offsets of the samples (1, K) in a row-major map of ``columns`` columns."""
        cached = self._indices.get(columns)
        if cached is None:
            cached = self._indices[columns] = (self.rows * columns + self.columns)[None, :]
        return cached

    @property
    def centre(self) -> int:
        """Index of the centre sample."""
        return self.rows.size // 2


@lru_cache
def patch_template(rings: int) -> PatchTemplate:
    """The template of ``rings`` steps around the nearest vertex (the report's collider-size, Figure 10)."""
    size = 2 * rings + 1
    offsets = np.arange(-rings, rings + 1)
    rows, columns = (axis.ravel() for axis in np.meshgrid(offsets, offsets, indexing="ij"))
    corner = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + size + 1], axis=1)
    upper = np.stack([corner, corner + size + 1, corner + size], axis=1)
    triangles = np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32)
    template = PatchTemplate(rings, size, rows, columns, triangles)
    for array in (template.rows, template.columns, template.triangles):
        array.setflags(write=False)
    return template
