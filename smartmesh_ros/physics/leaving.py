"""Tells when a body goes farther than its patch reaches."""

from __future__ import annotations

from smartmesh_ros.compiled import compiled


@compiled
def leaves_support(positions, moved, states, supports, shapes, slack, fastest):
    """Whether any body goes farther in the next step than it was taken to until the next update, from ``states`` (N,
    13) on; ``positions``, ``moved`` (N, 3) [m]: where it is and how far it moves in a step. Bodies that move further
    than ``fastest`` [m] are no reason."""
    for i in range(len(positions)):
        went = step = 0.0
        for axis in range(3):
            went += (positions[i, axis] + moved[i, axis] - states[i, axis]) ** 2
            step += moved[i, axis] ** 2
        if step <= fastest * fastest and went > (supports[i].margin + slack * shapes[i].radius) ** 2:
            return True
    return False
