"""Ground so lively that telling how little of it a body needs takes longer than giving it all that it can touch."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.choice import FIELD, FIXED, NONE, Choice
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# Maps that come at least every so many steps leave nothing to save between them.
OFTEN = 1.5
# For so long such bodies get a patch of fixed extent and are not looked at [s].
UNLOOKED = 0.1
# Not where it would be a coarser one: under bodies that reach further [samples].
FINE = 3.5
# Where more than this share of the bodies is not looked at, nobody's plane is worth a look.
CROWD = 0.5


def in_vain(
    choice: Choice, before: IntArray, centres: FloatArray, radii: FloatArray, approach: FloatArray, *, crowd: bool
) -> BoolArray:
    """Under which bodies a look was in vain (n,): it found again that they need a patch, or that they will soon,
    ``approach``-ing (n,) [m/s] the ground. ``before`` (n,): what they stood on; ``centres`` (n, 3) [m], ``radii`` (n,)
    [m]: the bodies in their windows; ``crowd``: whether most others are not looked at."""
    planes = choice.planes_at(0)
    gap = planes.above(centres) / planes.steepness() - radii
    if crowd:
        return np.ones(len(radii), bool)
    vain = (choice.state == FIELD) & ((before == FIELD) | (before == FIXED))
    return np.asarray(vain | (choice.state == NONE) & (gap <= approach * UNLOOKED))
