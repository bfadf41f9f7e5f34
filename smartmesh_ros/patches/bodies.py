"""What is remembered about each body from update to update."""

from typing import Any

import numpy as np

from smartmesh_ros.terrain.grid import IntArray


def carry_over(owner: Any, fills: dict[str, Any], kept: IntArray) -> None:
    """Makes the arrays of ``owner`` named in ``fills`` fit a new set of bodies.

    ``kept``: each body's index before, or -1 if it is new; ``fills``: what new bodies start with.
    """
    known = kept >= 0
    for name, fill in fills.items():
        old = getattr(owner, name)
        new = np.full((len(kept), *old.shape[1:]), fill, old.dtype)
        new[known] = old[kept[known]]
        setattr(owner, name, new)
