"""Supports: the ground under each body, one table with a record for the slot of each body. A body keeps its slot for
life, so rows of such tables never move."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np


class Support(IntEnum):
    """Kind of ground under a body.

    NONE: no ground that the body can touch. FIELD: a rectangle of samples. MESH: triangles of a general mesh.
    """

    NONE = 0
    FIELD = 1
    MESH = 2


# ``state``: a `Support`; ``tile``: index of the tile, -1 = none.
# The rectangle: first sample ``row``, ``column``; ``rows`` x ``columns`` samples, ``stride`` samples of the map apart.
# ``foot_*`` [m]: the ground's point nearest to the body; ``facet_*``: the ground's upward unit normal; ``gap`` [m]:
# distance between ground and body, negative if they overlap.
# ``rise`` [m/s]: vertical velocity of the ground at the foot; ``slide_x``, ``slide_y`` [m/s]: horizontal velocity;
# ``turn_*`` [rad/s]: angular velocity. All three are means until the next update.
# ``deviation`` [m]: bound on the distance between the patch and the main mesh where the body can touch it; NaN =
# unknown.
SUPPORT = np.dtype(
    (
        np.record,
        [
            ("state", np.int64),
            ("tile", np.int64),
            ("row", np.int64),
            ("column", np.int64),
            ("rows", np.int64),
            ("columns", np.int64),
            ("stride", np.int64),
            *((name, np.float64) for name in ("foot_x", "foot_y", "foot_z", "gap")),
            *((name, np.float64) for name in ("facet_x", "facet_y", "facet_z")),
            *((name, np.float64) for name in ("rise", "turn_x", "turn_y", "turn_z", "slide_x", "slide_y", "deviation")),
        ],
    )
)


def no_supports(count: int) -> Any:
    """Return a table of ``count`` bodies without support."""
    table = np.zeros(count, SUPPORT)
    table["tile"] = -1
    table["gap"], table["deviation"] = np.inf, np.nan
    return table
