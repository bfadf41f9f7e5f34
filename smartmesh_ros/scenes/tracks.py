"""A tracked machine on a flat of soil before a ramp of 20 degrees: ground, and the speeds of its tracks."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from smartmesh_ros.terrain.heightmap import HeightMap

SPACING = 0.04  # of the map [m]
ORIGIN = (-2.0, -2.6)  # first sample of the map [m]; the machine starts at x = y = 0
SIZE = (11.2, 5.2)  # of the map [m]
SLOPE = math.radians(20.0)
FOOT, RAMP, TOP = 3.0, 4.5, 7.3  # where the ground begins to rise, is as steep as the ramp, and becomes level [m]
FLATTENING = 1.0  # way on which it becomes level [m]
# Until when [s], and the speeds [m/s] of the left and right track: stand, drive, turn once on the spot, climb.
PLAN = ((1.0, 0.0, 0.0), (4.0, 0.5, 0.5), (15.1, -0.4, 0.4), (25.5, 0.5, 0.5))


def robot_file() -> Path:
    """Return the URDF of an excavator's undercarriage, with the driven surfaces ``left_track`` and ``right_track``."""
    return Path(__file__).parent / "undercarriage.urdf"


def ground() -> HeightMap:
    """Return level ground with the ramp, which rises along x."""
    x = ORIGIN[0] + SPACING * np.arange(round(SIZE[0] / SPACING) + 1)
    begins = np.clip((x - FOOT) / (RAMP - FOOT), 0.0, 1.0)
    ends = np.clip((TOP + FLATTENING - x) / FLATTENING, 0.0, 1.0)
    heights = np.cumsum(math.tan(SLOPE) * begins * ends) * SPACING
    return HeightMap(np.tile(heights, (round(SIZE[1] / SPACING) + 1, 1)), resolution=SPACING, origin=ORIGIN)


def speeds(time: float) -> dict[str, float]:
    """Return the speeds of the tracks [m/s] at a ``time`` [s]."""
    left, right = next((tracks for until, *tracks in PLAN if time < until), (0.0, 0.0))
    return {"left_track": left, "right_track": right}
