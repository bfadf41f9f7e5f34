"""Corrections of static ground: new estimates of its heights, blended in over a short time.

A correction has no velocity. The shown heights change linearly from the old estimate to the new one. The caller that
steps the physics sets the instant, so that the ground, its colliders and the bodies on it move together.
"""

from __future__ import annotations

from smartmesh_ros.compiled import compiled

# Side of the square blocks of samples that share one clock [samples], a power of two, and its exponent.
BLOCK_SHIFT = 6
BLOCK = 1 << BLOCK_SHIFT


@compiled
def remaining(clock, shown, settle):
    """Return the fraction of a block's correction that is not yet blended in at the instant ``shown`` [s]."""
    elapsed = shown - clock.middle
    if not elapsed < settle:
        return 0.0
    return 1.0 - max(elapsed, 0.0) / settle
