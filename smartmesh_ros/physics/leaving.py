"""Detects bodies that leave the ground their patch covers."""

from __future__ import annotations

from smartmesh_ros.compiled import compiled


@compiled
def leaves_support(chosen, positions, moved, states, margins, radii, slack, fastest):
    """Return True if any body in the slots ``chosen`` (n,) moves farther, by the end of the next step, than its support
    was made for.

    ``states`` (S, 13): at the last update; ``positions`` (S, 3) [m]: now; ``moved`` (S, 3) [m]: motion in one step.
    ``margins``, ``radii`` (S,) [m]: predicted motions of the supports, and bounding radii. Bodies that move more than
    ``fastest`` [m] in a step are ignored.
    """
    for k in range(len(chosen)):
        i = chosen[k]
        went = step = 0.0
        for axis in range(3):
            went += (positions[i, axis] + moved[i, axis] - states[i, axis]) ** 2
            step += moved[i, axis] ** 2
        if step <= fastest * fastest and went > (margins[i] + slack * radii[i]) ** 2:
            return True
    return False
