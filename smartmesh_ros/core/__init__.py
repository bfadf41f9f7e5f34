"""The core in C++: the reader of moving ground, contacts of convex shapes with it, and PyBullet's plugin."""

from __future__ import annotations

import importlib
from typing import Any

try:
    CORE: Any = importlib.import_module("smartmesh_ros.core._core")
except ImportError as error:
    raise ImportError(
        "the C++ core of smartmesh_ros is not built for this Python: run make, colcon build or pip install, with a C++ "
        "compiler (Debian: apt install g++ python3-dev)"
    ) from error
