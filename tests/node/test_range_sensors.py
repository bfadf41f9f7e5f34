"""Directions of the rays of range sensors."""

from dataclasses import replace

import numpy as np

from smartmesh_ros.node.sensor.range_sensors import Lidar


def test_the_sectors_of_a_turn_are_the_turn() -> None:
    lidar = Lidar()
    whole = replace(lidar, sectors=1).directions_s(0)
    parts = np.concatenate([lidar.directions_s(look) for look in range(lidar.sectors)])
    rounded = [{tuple(ray) for ray in np.round(rays, 6).tolist()} for rays in (whole, parts)]
    assert rounded[0] == rounded[1]
    assert len(rounded[0]) == lidar.beams * lidar.steps
