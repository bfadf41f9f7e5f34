"""What bodies stand on: one table, a record for each body."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np


class Support(IntEnum):
    """What a body has under it.

    NONE: nothing that it can touch until the next update. PLANE: the plane of the ground under it; where its middle is
    below the ground, that of the facet over it, whose foot is straight over the middle and whose deviation is unknown.
    FIELD: a rectangle of samples. MESH: triangles of a general mesh, or a rectangle whose collider is a mesh. ACROSS:
    to be chosen by the samples of several tiles.
    """

    NONE = 0
    PLANE = 1
    FIELD = 2
    MESH = 3
    ACROSS = 4


# ``state``: a `Support`; ``tile``: index of the tile, -1 = on none.
# The rectangle: first sample ``row``, ``column``; ``rows`` x ``columns`` samples, ``stride`` samples of the map apart.
# ``foot_*`` [m]: the ground's point nearest to the body; ``normal_*``: from there to the body, unit; ``gap`` [m]: how
# far apart they are, negative where they overlap; ``facet_*``: the ground's upward normal there.
# ``rise`` [m/s]: how fast the ground rises there, ``turn_*`` [rad/s]: how it turns, ``slide_x``, ``slide_y``
# [m/s]: how it slides; means until the next update.
# ``deviation`` [m]: how far the collider lies from the main mesh where the body can touch it, at most; NaN = unknown.
# ``margin`` [m]: how far the body was taken to move relative to the ground until the next update.
# ``first``: where its heights start among those of all fields, -1 = it has none.
SUPPORT = np.dtype(
    [
        ("state", np.int64),
        ("tile", np.int64),
        ("row", np.int64),
        ("column", np.int64),
        ("rows", np.int64),
        ("columns", np.int64),
        ("stride", np.int64),
        *((name, np.float64) for name in ("foot_x", "foot_y", "foot_z", "normal_x", "normal_y", "normal_z", "gap")),
        *((name, np.float64) for name in ("facet_x", "facet_y", "facet_z")),
        *(
            (name, np.float64)
            for name in ("rise", "turn_x", "turn_y", "turn_z", "slide_x", "slide_y", "deviation", "margin")
        ),
        ("first", np.int64),
    ]
)


def no_supports(count: int) -> Any:
    """A table of bodies that have nothing yet."""
    table = np.zeros(count, SUPPORT).view(np.recarray)
    table["tile"] = table["first"] = -1
    table["gap"], table["deviation"] = np.inf, np.nan
    return table
