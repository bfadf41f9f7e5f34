"""Where telling how little ground a body needs takes longer than giving it all that it can touch: on lively ground,
and under bodies that cross rough ground in a hurry."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.choice import FACET, FIELD, FITTED, FIXED, NONE, Choice
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# Maps that come at least every so many updates leave colliders nothing to last for.
OFTEN = 1.5
# For so long such bodies get a patch of fixed extent and are not looked at [s]; twice as long each time that looking
# was found in vain again, up to the longest.
UNLOOKED, LONGEST = 0.1, 0.4
# Whoever is above the ground counts as on it if it comes there within so long [s].
SOON = 0.03
# Not where it would be a coarser one: under bodies that reach further [samples].
FEW = 3.5
# On ground at rest: bodies whose look lasts for fewer updates.
HURRY = 24
# Nor where there are more bodies: a look costs about the same for one as for a hundred, and a patch for each.
MANY = 200


def mostly_fields(state: IntArray) -> bool:
    """Whether more of few bodies stand on patches than on planes, which are worth looking for."""
    if len(state) > MANY:
        return False
    fields = np.count_nonzero((state == FIELD) | (state == FIXED))
    return bool(fields > np.count_nonzero((state == FACET) | (state == FITTED)))


def mostly_unlooked(state: IntArray) -> bool:
    """Whether so few bodies are looked at that looking at them costs more than all their patches."""
    return bool(np.count_nonzero(state == FIXED) > 0.5 * len(state))


def reaches_few(reach: FloatArray, resolution: float) -> BoolArray:
    """Which bodies reach so few samples (n,) that a patch of fixed extent leaves none out."""
    return np.asarray(reach <= FEW * resolution)


def unlooked_for(before: FloatArray) -> FloatArray:
    """For how long to leave bodies unlooked (n,) [s] that were left so for so long ``before`` (n,) [s]."""
    return np.clip(2.0 * before, UNLOOKED, LONGEST)


def look_again(time: float, unlooked: FloatArray) -> FloatArray:
    """When to look at bodies again (n,) [s] that are left ``unlooked`` for about so long (n,) [s]: at instants they
    share, as a look costs about the same for one body as for many."""
    return UNLOOKED * np.ceil((time + unlooked) / UNLOOKED - 0.5)


def in_vain(
    choice: Choice, before: IntArray, centres: FloatArray, radii: FloatArray, approach: FloatArray, *, crowd: bool
) -> BoolArray:
    """Under which bodies a look was in vain (n,): it found again that they need a patch, or that they will soon, as
    they ``approach`` (n,) [m/s] the ground. ``before`` (n,): what they stood on; ``centres`` (n, 3) [m], ``radii`` (n,)
    [m]: the bodies in their windows; ``crowd``: whether most are not looked at, so that planes are no gain either."""
    planes = choice.planes_at(0)
    gap = planes.above(centres) / planes.steepness() - radii
    stands = choice.state != NONE
    if not crowd:
        stands &= (choice.state == FIELD) & ((before == FIELD) | (before == FIXED))
    return np.asarray(stands | (choice.state == NONE) & (gap <= approach * SOON))
