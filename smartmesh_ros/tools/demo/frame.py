"""An instant of the demo. Without Matplotlib, which its pictures need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Frame:
    """The recorded scene at one time: ``heights`` (n, m) [m] of the ground in rows at ``y`` (n,) and columns at ``x``
    (m,) [m], ``triangles`` of the patches (T, 3, 3) [m], and positions [m] of the ``bodies`` by name."""

    time: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heights: NDArray[np.float32]
    triangles: NDArray[np.float64]
    bodies: dict[str, tuple[float, float, float]]
