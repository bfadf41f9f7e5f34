"""Colours of ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

GROUND: Colour = (196, 186, 168)
# Colours of ground whose coefficient of friction is not 1, by the least coefficient of each.
FRICTION: dict[float, Colour] = {
    0.0: (112, 176, 236),
    0.3: (152, 196, 226),
    0.7: (182, 200, 206),
    1.0: (160, 112, 66),
}


def ground_colours(friction: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return the colours (..., 3) of ground with coefficients of friction (...); NaN counts as 1."""
    bands = np.digitize(friction, list(FRICTION)) - 1
    bands[np.isnan(friction) | (friction == 1.0)] = -1
    colours: NDArray[np.uint8] = np.array([*FRICTION.values(), GROUND], np.uint8)[bands]
    return colours
