"""A wheel that was measured."""

from __future__ import annotations

from typing import NamedTuple

from studies.soil.trials import Wheel


class Measured(NamedTuple):
    """A run of the smooth wheel of robomechanics/3d-terramechanics: pull, load [N] and sinkage [m] at a slip."""

    slip: float
    pull: float
    load: float
    sinkage: float


SMOOTH = (
    Measured(-0.5, -17.2, 23.2, 23.7e-3), Measured(-0.2, -7.3, 23.7, 15.1e-3), Measured(0.0, -1.3, 24.6, 14.4e-3),
    Measured(0.23, 0.7, 24.6, 17.9e-3), Measured(0.5, 1.0, 25.3, 22.7e-3), Measured(0.75, 0.8, 24.0, 25.4e-3),
    Measured(0.9, 1.5, 25.7, 25.7e-3),
)  # fmt: skip
K10 = Wheel(radius=0.058, width=0.05, load=24.6)
