"""Bodies that press the soil, as the core sees them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.patches.shapes import SHAPE

# First row and column of no samples; their last row and column are -1.
NOWHERE = 2**31 - 1

# A body that presses the soil. ``shape``: a record of ``SHAPE``. ``state``: position, quaternion, linear and
# angular velocity of the body's frame in the world. ``force`` [N]: vertical contact force of the last update, at the
# distance ``place`` (2,) [m] from the body's position along x and y of the world, NaN = unknown; ``load`` [N],
# ``centre_of_load`` (2,): the same, filtered. ``seat`` [m]: height of the shape's middle without the map's z, at which
# the soil carries the load; ``slope`` (2,): of the pressed plane, along columns and rows. ``pressed``, ``seen``: first
# row and column, last row and column of the samples that it pressed last, and of those that the next update must look
# at. Results: ``sinkage`` [m], the deepest; ``area`` [m^2]; ``carried`` [N], by the soil's pressure; ``grip``, shear
# force over pressing force; ``displaced`` [m^3], in the last update.
FOOT = np.dtype(
    [
        ("shape", SHAPE), ("state", np.float64, 13), ("force", np.float64), ("place", np.float64, 2),
        ("load", np.float64), ("centre_of_load", np.float64, 2), ("seat", np.float64), ("slope", np.float64, 2),
        ("pressed", np.int32, 4), ("seen", np.int32, 4), ("sinkage", np.float64), ("area", np.float64),
        ("carried", np.float64), ("grip", np.float64), ("displaced", np.float64),
    ]
)  # fmt: skip


def with_room(feet: Any, count: int) -> Any:
    """Return ``count`` records of ``FOOT``, the first of which are ``feet``."""
    more = np.zeros(count - len(feet), FOOT)
    more["pressed"] = more["seen"] = NOWHERE, NOWHERE, -1, -1
    more["seat"] = math.nan
    return np.concatenate((feet, more))
