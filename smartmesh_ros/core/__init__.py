"""The core in C++: the reader of moving ground, contacts of convex shapes with it, and PyBullet's plugin."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

try:
    CORE: Any = importlib.import_module("smartmesh_ros.core._core")
except ImportError as error:
    raise ImportError(
        "the C++ core of smartmesh_ros is not built for this Python: run make, colcon build or pip install, with a C++ "
        "compiler (Debian: apt install g++ python3-dev)"
    ) from error


def dtype_of(layout: Any) -> np.dtype[Any]:
    """Return the NumPy type of records of the core, by its layout of them."""
    size, fields = layout
    names, codes, counts, places = zip(*fields, strict=True)
    formats = [(f"{code}8", (count,) if count > 1 else ()) for code, count in zip(codes, counts, strict=True)]
    record = np.dtype({"names": names, "formats": formats, "offsets": places, "itemsize": size})
    return np.dtype((np.record, record))
