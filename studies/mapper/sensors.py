"""What the rover's sensors measure of the ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.node.sensor.range_sensors import RangeSensor
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.distance import Surface
from studies.mapper.poses import Pose
from studies.mapper.rays import cast_rays


class Scan(NamedTuple):
    """The returns of one look, in the body: where the rays start (3,) [m], their unit directions (N, 3), the measured
    ranges (N,) [m] and the standard deviations (N,) [m] that the sensor gives for them.

    It only knows what it measured, so a range measured too short counts for more than it should, and a flat ray's noise
    chooses the place that it seems to hit: as in the field, errors of a map are larger than deviations alone make them.
    """

    start_b: FloatArray
    directions_b: FloatArray
    ranges: FloatArray
    deviations: FloatArray

    @property
    def points_b(self) -> FloatArray:
        """What was hit (N, 3) [m]."""
        return self.start_b + self.directions_b * self.ranges[:, None]


def scan(sensor: RangeSensor, ground: Surface, pose: Pose, look: int, rng: np.random.Generator) -> Scan:
    """What the sensor measures of the true ground from the rover's true pose."""
    directions_b, start_b = sensor.directions_b(look), np.array(sensor.position_b)
    start_w = pose.position + pose.rotation @ start_b
    true = cast_rays(ground, start_w, directions_b @ pose.rotation.T, sensor.farthest)
    returned = true >= sensor.nearest
    ranges = true[returned] + rng.normal(size=int(returned.sum())) * sensor.noise.deviation(true[returned])
    return Scan(start_b, directions_b[returned], ranges, sensor.noise.deviation(ranges))
