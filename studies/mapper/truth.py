"""The true ground under the rover: the elevation model, scaled to a field, with bumps on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.evaluation.grounds import elevation


@dataclass(frozen=True, kw_only=True)
class TruthConfig:
    """A square field around the origin.

    ``side`` [m]: the rover's way and some metres around it. ``resolution`` [m]: half a cell of a usual elevation map,
    so that there is ground between the cells as in the field. ``spacing`` [m]: between the model's samples; and
    ``relief`` [m]: from the lowest to the highest point of the whole model. Together they make hills that a rover
    climbs and on which boxes hold: 10 degrees steep in the middle, 16 at most in nine tenths of the field.
    ``bumps`` [m]: standard deviation of what lies on it, ``bump_length`` [m] apart: about a wheel's radius. ``seed``:
    of the bumps.
    """

    side: float = 30.0
    resolution: float = 0.05
    relief: float = 1.5
    spacing: float = 0.25
    bumps: float = 0.01
    bump_length: float = 0.3
    seed: int = 1


def true_ground(config: TruthConfig) -> Surface:
    """The field, around the origin of the world. Needs Matplotlib's sample data."""
    size, half = round(config.side / config.resolution) + 1, 0.5 * config.side
    geometry = GridGeometry(rows=size, columns=size, resolution=config.resolution, origin=(-half, -half, 0.0))
    model: FloatArray = np.asarray(elevation(geometry, config.spacing, config.relief).heights(0.0), np.float64)
    places: FloatArray = np.arange(geometry.rows, dtype=np.float64) * (config.resolution / config.bump_length)
    nodes = int(places[-1]) + 2
    bumps = np.random.default_rng(config.seed).normal(0.0, config.bumps, (nodes, nodes))
    return Surface(geometry, model + _between(bumps, places))


def _between(nodes: FloatArray, places: FloatArray) -> FloatArray:
    """Bilinear heights (n, n) between nodes (m, m), at places (n,) [nodes] along both axes."""
    low = np.floor(places).astype(np.int64)
    share = places - low
    along = nodes[low] * (1.0 - share)[:, None] + nodes[low + 1] * share[:, None]
    return np.asarray(along[:, low] * (1.0 - share) + along[:, low + 1] * share)
