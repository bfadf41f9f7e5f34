"""A simulated mapper for tests: maps with noise, holes, drift and corrections, and the true ground."""

from smartmesh_ros.node.sensor.range_sensors import DepthCamera, Lidar, RangeNoise, RangeSensor
from studies.mapper.drift import NO_DRIFT, DriftConfig
from studies.mapper.elevation_mapper import MapperConfig
from studies.mapper.mapping import Drive, MapFrame, MappingConfig, mapped_terrain
from studies.mapper.poses import LoopPath, Pose
from studies.mapper.truth import TruthConfig, true_ground

__all__ = [
    "NO_DRIFT",
    "DepthCamera",
    "DriftConfig",
    "Drive",
    "Lidar",
    "LoopPath",
    "MapFrame",
    "MapperConfig",
    "MappingConfig",
    "Pose",
    "RangeNoise",
    "RangeSensor",
    "TruthConfig",
    "mapped_terrain",
    "true_ground",
]
